//! The order that planned cameras leave in.

use crate::support::command::{FILES, Place, SHORT};
use camsplat::planner::plan::record::PlanRecord;
use glam::DVec3;

fn places(record: &PlanRecord) -> Vec<DVec3> {
    record.cameras.iter().map(|camera| camera.pose.position).collect()
}

fn length(way: &[DVec3]) -> f64 {
    way.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
}

/// If this failed, the order would change the plan, the tour would be no shorter than what it was made of, would cut through the
/// object, or its record would be of another way than the cameras are in.
#[test]
fn a_tour_visits_the_same_cameras_in_fewer_steps() {
    let place = Place::new();
    let small = SHORT.replace("--views 5", "--views 30");
    let told = place.run(&format!("plan ball.ply {small} --out tour"));
    assert_eq!(told.code, Some(0), "{}", told.err);
    let untold = place.run(&format!("plan ball.ply {small} --out none --order none"));
    assert_eq!(untold.code, Some(0), "{}", untold.err);
    let (sorted, as_planned) = (place.plan("tour"), place.plan("none"));
    let (near, far) = (places(&sorted), places(&as_planned));
    let matches = |p: &DVec3, others: &[DVec3]| others.iter().filter(|q| *q == p).count();
    assert!(near.iter().all(|p| matches(p, &far) == 1) && near.len() == far.len(), "other cameras");
    let names = |record: &PlanRecord| record.cameras.iter().map(|camera| camera.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&sorted), names(&as_planned));
    let tour = sorted.tour.as_ref().expect("no tour in plan.json");
    assert!((tour.length - length(&tour.path)).abs() < 1e-6 && tour.blocked == 0, "{tour:?}");
    assert!(tour.length < 0.6 * length(&far), "{} beside {}", tour.length, length(&far));
    assert!(as_planned.tour.is_none() && !untold.out.contains("tour "), "{}", untold.out);
    assert!(told.out.contains(&format!("{:.3} long", tour.length)), "{}", told.out);
    let mut on_the_way = near.iter();
    let mut next = on_the_way.next();
    for corner in &tour.path {
        if next.is_some_and(|p| p.distance(*corner) < 1e-9) {
            next = on_the_way.next();
        }
    }
    assert!(next.is_none(), "the way misses the camera at {next:?}");
    for pair in tour.path.windows(2) {
        for i in 0..=20 {
            let p = pair[0].lerp(pair[1], f64::from(i) / 20.0);
            assert!(p.length() > 1.0, "through the ball at {p}");
        }
    }
    assert!(place.read("tour/report.html").contains("long from the first camera to the last"));
    assert!(FILES.iter().all(|name| place.path("tour").join(name).exists()));
}

/// If this failed, cameras that were planned one after the other would lose the order that makes the first of them a plan of fewer.
#[test]
fn cameras_planned_one_by_one_stay_in_their_order() {
    let place = Place::new();
    for (folder, options) in [("own", ""), ("none", "--order none")] {
        let ran = place.run(&format!("plan ball.ply {SHORT} --method paper-iterative {options} --out {folder}"));
        assert_eq!(ran.code, Some(0), "{}", ran.err);
    }
    assert_eq!(place.plan("own").cameras, place.plan("none").cameras);
    assert!(place.plan("own").tour.is_none());
}

/// If this failed, a plan of very many cameras would take hours and all memory for its tour, or be without one and not say so.
#[test]
fn too_many_cameras_for_a_tour_are_said() {
    let place = Place::new();
    let ran = place.done("plan ball.ply --views 2001 --held-out 20 --iterations 1 --out many");
    assert!(ran.out.contains("no tour") && ran.out.contains("2000 cameras at most"), "{}", ran.out);
    assert!(place.plan("many").tour.is_none() && place.plan("many").cameras.len() == 2001);
}
