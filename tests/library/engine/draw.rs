//! A renderer that draws the planner's cameras.

#[path = "../../../examples/draw/main.rs"]
#[allow(dead_code, reason = "an example, whose `main` is not called here")]
mod example;

use example::draw;

/// If this failed, a host that draws what the engine has written would draw what was there before, or nothing; or the validation layers,
/// synchronisation too, would have something to say of the barriers between the engine and the draw.
#[test]
fn a_host_draws_what_the_planner_leaves() {
    let [(first, messages), (third, more)] = [1, 3].map(|frames| draw(frames, true).unwrap());
    assert_eq!([messages, more].concat(), [""; 0]);
    let background = &first[..4];
    let drawn = |pixels: &[u8]| pixels.chunks(4).filter(|pixel| *pixel != background).count();
    // Forty points of a few pixels each; where there are no large ones, of one.
    assert!((20..60_000).contains(&drawn(&first)), "{} pixels", drawn(&first));
    assert_ne!(first, third, "the cameras have not moved");
}
