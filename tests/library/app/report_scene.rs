//! What the forms and clicks of a plan's 3D view do, in a real browser where there is one.

use glam::DVec3;

use super::report_page::{ball, room};
use crate::support::browser::{acting, rendered, write};
use camsplat::planner::plan::record::TourRecord;

/// The form selects a camera and looks through it; the pointer finds one too.
#[test]
fn a_camera_is_found_and_looked_through() {
    let act = r#"<script>setTimeout(() => {
        const form = document.querySelector("form"), canvas = document.querySelector("canvas");
        const box = canvas.getBoundingClientRect();
        const found = () => !document.querySelector(".tip").hidden;
        for (let y = 0.3; y < 0.7 && !found(); y += 0.05) {
            for (let x = 0; x < box.width && !found(); x += 5) {
                const at = { clientX: box.left + x, clientY: box.top + y * box.height, bubbles: true };
                canvas.dispatchEvent(new PointerEvent("pointermove", at));
            }
        }
        document.body.dataset.tip = document.querySelector(".tip b")?.textContent;
        form.camera.value = 20;
        form.camera.dispatchEvent(new Event("change"));
        form.look.click();
    }, 200);</script></body>"#;
    let page = ball().page().replace("</body>", act);
    if let Some(dom) = rendered(&write("look", &page), &[]) {
        assert!(dom.contains(r#"data-ready="ok""#), "a script failed");
        assert!(dom.contains(r#"data-tip="view_0"#), "no camera was found under the pointer");
        assert!(dom.contains(r#"class="frame" style="left:"#), "the frame of the image is not shown");
        assert!(dom.contains("Leave the camera"));
    }
}

/// If this failed, the options that a click on a wall gives would put the wall elsewhere, or bar the side that cameras are on; or a box
/// would not hold what was clicked.
#[test]
fn clicks_on_the_surface_give_options_to_paste() {
    let numbers = |text: &str| text.split(',').map(|n| n.parse::<f64>().unwrap()).collect::<Vec<_>>();
    let script = r#"
        const form = document.querySelector("form"), canvas = document.querySelector("canvas"), size = canvas.getBoundingClientRect();
        const click = (x, y) => {
            const at = { clientX: size.left + x * size.width, clientY: size.top + y * size.height, bubbles: true, button: 0, pointerId: 1 };
            canvas.setPointerCapture = () => {};
            for (const kind of ["pointerdown", "pointerup"]) canvas.dispatchEvent(new PointerEvent(kind, at));
        };
        const mark = (name) => {
            form.mark.value = name;
            form.mark.dispatchEvent(new Event("input", { bubbles: true }));
        };
        mark("wall");
        document.body.dataset.before = String(form.options.hidden);
        click(0.5, 0.5);
        document.body.dataset.wall = form.options.value;
        mark("box");
        click(0.47, 0.47);
        click(0.55, 0.55);
        document.body.dataset.box = form.options.value;
        mark("");
        document.body.dataset.after = String(form.options.hidden);"#;
    let clicked = |name: &str, page: &str| {
        let dom = rendered(&write(name, &acting(page, script)), &[])?;
        assert!(dom.contains(r#"data-ready="ok""#), "a script failed");
        assert!(dom.contains(r#"data-before="true""#) && dom.contains(r#"data-after="true""#));
        let said = |name: &str| {
            let rest = &dom[dom.find(&format!("data-{name}=\"")).unwrap() + name.len() + 7..];
            rest[..rest.find('"').unwrap()].to_owned()
        };
        let wall = numbers(said("wall").strip_prefix("--wall ").unwrap());
        Some(([0, 3].map(|k| DVec3::from_slice(&wall[k..k + 3])), said("box")))
    };
    // The ball's surface is tangent to what is laid through its points, and cameras are outside.
    let Some(([point, normal], text)) = clicked("marks", &ball().page()) else { return };
    assert!((point.length() - 1.0).abs() < 0.05 && normal.dot(point.normalize()) > 0.97, "{point} {normal}");
    let corners = numbers(text.strip_prefix("--box ").unwrap().lines().next().unwrap());
    let [low, high] = [0, 3].map(|k| DVec3::from_slice(&corners[k..k + 3]));
    assert!((high - low).min_element() >= 0.0 && (0.05..0.8).contains(&(high - low).length()), "{text}");
    assert!(text.contains("{&quot;boxes&quot;") || text.contains("keep-out box.json"), "{text}");
    // Seen from outside and above, a room's walls keep the side where its cameras are.
    let stage = room();
    let ([point, normal], _) = clicked("marks_room", &stage.page()).unwrap();
    let cameras = stage.record.cameras.iter().filter(|camera| (camera.pose.position - point).dot(normal) > 0.0);
    assert!(2 * cameras.count() > stage.record.cameras.len(), "{point} {normal}");
}

/// If this failed, a switch of the 3D view would do nothing, or the numbers and the way of a tour would stay where they are not wanted.
#[test]
fn tour_numbers_and_floor_can_be_hidden() {
    let mut stage = ball();
    let planned = stage.record.cameras.len() - stage.record.kept;
    let path = stage.record.cameras[..planned].iter().map(|camera| camera.pose.position).collect();
    stage.record.tour = Some(TourRecord { length: 12.5, path, blocked: 0 });
    // Redrawing waits for a frame, which is a timer here.
    let script = r#"
        const form = document.querySelector("form"), [view, overlay] = document.querySelectorAll(".stage canvas");
        const names = [["tour", view], ["numbers", overlay], ["region", view], ["cameras", view]];
        document.body.dataset.legend = document.querySelector(".legend").textContent;
        const next = () => {
            if (names.length === 0) return;
            const [name, canvas] = names.shift(), before = pixels(canvas);
            form.elements.namedItem(name).click();
            setTimeout(() => {
                document.body.dataset[name] = pixels(canvas) === before ? "the same" : "hidden";
                next();
            }, 50);
        };
        next();"#;
    if let Some(dom) = rendered(&write("toggles", &acting(&stage.page(), script)), &[]) {
        assert!(dom.contains(r#"data-ready="ok""#), "a script failed");
        for name in ["tour", "numbers", "region", "cameras"] {
            assert!(dom.contains(&format!("data-{name}=\"hidden\"")), "{name} changes nothing");
        }
        let legend = &dom[dom.find("data-legend=").unwrap()..][..120];
        assert!(
            legend.contains("planned camera") && legend.contains("kept camera") && legend.contains("tour"),
            "{legend}"
        );
    }
}
