//! What was understood of a capture, in plain words.

use std::collections::BTreeMap;

use glam::DVec3;

use super::PhotoSet;

/// A line each on the convention of the poses, images and masks found and missing, image sizes and lenses, where cameras and
/// points lie, which way is up, and the mean reprojection error where there are tracks.
pub fn describe(set: &PhotoSet) -> Vec<String> {
    let photos = &set.photos;
    let count = photos.len();
    let images = photos.iter().filter(|photo| photo.image.is_some()).count();
    let masks = photos.iter().filter(|photo| photo.mask.is_some()).count();
    let mut notes = vec![format!("poses: {}", set.convention)];
    let masked = if masks > 0 { format!(", {masks} with a mask file") } else { String::new() };
    notes.push(format!("{count} photos: {images} images found{masked}"));
    match &set.missing[..] {
        [] => {}
        [one] => notes.push(format!("missing or unreadable: {one}")),
        [first, rest @ ..] => notes.push(format!("missing or unreadable: {first} and {} more", rest.len())),
    }

    let mut sizes = BTreeMap::<_, u32>::new();
    let mut focal = (f64::INFINITY, 0f64);
    for photo in photos {
        let k = &photo.camera.intrinsics;
        *sizes.entry((k.width, k.height)).or_default() += 1;
        focal = (focal.0.min(k.focal[0]), focal.1.max(k.focal[0]));
    }
    let distorted = photos.iter().filter(|photo| !photo.distortion.is_none()).count();
    let size = match sizes.iter().next() {
        Some(((w, h), _)) if sizes.len() == 1 => format!("{w} x {h} pixels"),
        Some(((w, h), n)) => format!("{} sizes, {n} of {w} x {h} pixels among them", sizes.len()),
        None => "no size".into(),
    };
    let focal = match focal {
        (least, most) if most - least < 0.05 => format!("{least:.1}"),
        (least, most) => format!("{least:.1} to {most:.1}"),
    };
    let bent = match distorted {
        0 => "no distortion".into(),
        all if all == count => "distortion honoured".into(),
        some => format!("distortion honoured, {some} photos have some"),
    };
    notes.push(format!("images: {size}; focal length {focal} pixels; {bent}"));

    let centres: Vec<DVec3> = photos.iter().map(|photo| photo.camera.pose.position).collect();
    if let Some((min, max)) = middle(&centres, 1.0) {
        notes.push(format!("camera centres: from {min:.3} to {max:.3}"));
    }
    let reach = set.reach();
    let mut strays = photos.iter().filter(|photo| !reach.holds(photo.camera.pose.position));
    if let Some(first) = strays.next() {
        let more = match strays.count() {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        notes.push(format!(
            "stray: {}{more} far away from all other cameras; left aside for the scale of the scene",
            first.camera.name
        ));
    }
    if let Some((min, max)) = middle(&set.points.positions, 0.9) {
        let error = set.errors.iter().map(|error| f64::from(*error)).sum::<f64>() / set.errors.len() as f64;
        let seen = set.tracks.iter().map(Vec::len).sum::<usize>() as f64 / set.tracks.len() as f64;
        let tracks = match set.tracks.is_empty() {
            true => String::new(),
            false => format!(", each seen in {seen:.1} photos with a mean reprojection error of {error:.2} pixels"),
        };
        let number = set.points.positions.len();
        notes.push(format!("points: {number}, nine tenths of them from {min:.3} to {max:.3}{tracks}"));
    }
    let up: DVec3 = photos.iter().map(|photo| photo.camera.pose.up()).sum::<DVec3>() / count.max(1) as f64;
    notes.push(match up.length() {
        // The photos are rolled every which way, or look straight down from all around.
        length if length < 0.2 => "up: the photos do not agree on one".into(),
        _ => format!("up: {:.3} by the photos, nearest axis {}", up.normalize(), axis(up)),
    });
    notes
}

/// The box that holds the middle `share` of positions along each axis; none where there are none.
fn middle(positions: &[DVec3], share: f64) -> Option<(DVec3, DVec3)> {
    if positions.is_empty() {
        return None;
    }
    let cut = (0.5 * (1.0 - share) * (positions.len() - 1) as f64) as usize;
    let mut bounds = (DVec3::ZERO, DVec3::ZERO);
    for axis in 0..3 {
        let mut values: Vec<f64> = positions.iter().map(|p| p[axis]).collect();
        values.sort_by(f64::total_cmp);
        bounds.0[axis] = values[cut];
        bounds.1[axis] = values[values.len() - 1 - cut];
    }
    Some(bounds)
}

/// The signed axis nearest to a direction.
fn axis(direction: DVec3) -> String {
    let i = direction.abs().max_position();
    format!("{}{}", if direction[i] < 0.0 { '-' } else { '+' }, ['X', 'Y', 'Z'][i])
}
