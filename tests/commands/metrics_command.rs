//! `camsplat metrics`: what is paired, what is printed and written, and that nothing but the images decides it.

use std::fs;

use crate::support::command::{Place, ended};
use crate::support::data::data_folder;
use crate::support::images::Image;
use camsplat::engine::vulkan::{Context, ContextOptions};
use camsplat::splats::image_metrics::{Lpips, Weights, psnr, ssim};
use serde_json::Value;

/// A place with a folder of images and one of references.
fn place() -> (Place, Vec<[Image; 2]>) {
    let place = Place::new();
    let images: Vec<[Image; 2]> =
        (0..3).map(|i| [Image::new(48 + i, 40, 1, 10), Image::new(48 + i, 40, 2, 40)]).collect();
    for folder in ["images", "reference"] {
        fs::create_dir(place.path(folder)).unwrap();
    }
    for (i, [image, reference]) in images.iter().enumerate() {
        place.write(&format!("images/r_{i}.png"), image.png());
        place.write(&format!("reference/r_{i}.PNG"), reference.png());
    }
    place.write("images/new.png", images[0][0].png());
    place.write("images/notes.txt", "not an image");
    place.write("reference/left.png", images[0][0].png());
    (place, images)
}

fn json(place: &Place, name: &str) -> Value {
    serde_json::from_str(&place.read(name)).unwrap()
}

/// If this failed, an image would be compared with another one's reference, or silently left out; or the command would
/// measure otherwise than the library.
#[test]
fn folders_are_paired_by_name_and_measured() {
    let (place, images) = place();
    let ran = place.done("metrics images reference --json m.json");
    assert!(ran.out.contains("pairs    3, transparent pixels over black\n"), "{}", ran.out);
    assert!(ran.out.contains("unpaired 1 only in images: new\n"), "{}", ran.out);
    assert!(ran.out.contains("unpaired 1 only in reference: left\n"), "{}", ran.out);
    let record = json(&place, "m.json");
    assert_eq!((&record["only_in_images"][0], &record["only_in_reference"][0]), (&"new".into(), &"left".into()));
    assert_eq!(record["background"], "black");
    let context = Context::new(&ContextOptions::default()).unwrap();
    let mut lpips = Lpips::new(&context, &Weights::alex().unwrap()).unwrap();
    let mut sums = [0.0; 3];
    for (i, [image, reference]) in images.iter().enumerate() {
        let (a, b) = (image.view(), reference.view());
        let expected = [psnr(&a, &b), ssim(&a, &b), lpips.distance(&a, &b)].map(Result::unwrap);
        let pair = &record["pairs"][i];
        assert_eq!(pair["name"], format!("r_{i}"));
        for (k, name) in ["psnr", "ssim", "lpips_alex"].into_iter().enumerate() {
            assert_eq!(pair[name], expected[k], "{name}");
            sums[k] += expected[k];
        }
        let row = format!("{:.2} {:.4} {:.4}", expected[0], expected[1], expected[2]);
        let words = |line: &str| line.split_whitespace().skip(1).collect::<Vec<_>>().join(" ");
        let line = ran.out.lines().find(|line| line.starts_with(&format!("r_{i} "))).map(words);
        assert_eq!(line, Some(row), "{}", ran.out);
    }
    for (k, name) in ["psnr", "ssim", "lpips_alex"].into_iter().enumerate() {
        assert!((record["mean"][name].as_f64().unwrap() - sums[k] / 3.0).abs() < 1e-12, "{name}");
    }
    assert_eq!(record["mean"]["lpips_vgg"], Value::Null);
    assert!(ran.out.lines().last().unwrap().starts_with("mean "), "{}", ran.out);
}

/// If this failed, a script that saves the table on a full disk would take a part of it for the whole.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_under_the_table_is_an_error() {
    let (place, _) = place();
    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let ran = ended(place.command("metrics images reference --json m.json").stdout(full).output().unwrap());
    assert_eq!((ran.code, ran.err.lines().count()), (Some(1), 1), "{}", ran.err);
    assert!(ran.err.starts_with("error: standard output did not take all"), "{}", ran.err);
    assert_eq!(json(&place, "m.json")["background"], "black");
    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let ran = ended(place.command("metrics --help").stdout(full).output().unwrap());
    assert_eq!((ran.code, ran.err.lines().count()), (Some(1), 1), "{}", ran.err);
}

/// If this failed, figures would take the place of an image or of the weights that they were measured with.
#[test]
fn what_is_compared_is_not_written_over() {
    let (place, _) = place();
    place.write("w.safetensors", "weights");
    for (file, options) in [("images/r_0.png", "--lpips none"), ("w.safetensors", "--lpips-alex w.safetensors")] {
        let before = fs::read(place.path(file)).unwrap();
        let ran = place.run(&format!("metrics images reference {options} --json {file}"));
        assert_eq!(ran.code, Some(2), "{}", ran.err);
        assert!(ran.err.contains(file) && ran.err.contains("would be replaced"), "{}", ran.err);
        assert_eq!(fs::read(place.path(file)).unwrap(), before);
    }
}

/// If this failed, an image that is perfect would make a file that is no JSON, or a device be requested without need.
#[test]
fn the_same_image_twice() {
    let (place, _) = place();
    let ran = place.done("metrics images/r_0.png images/r_0.png --lpips none --json m.json");
    assert!(!ran.out.contains("device") && !ran.out.contains("LPIPS"), "{}", ran.out);
    let record = json(&place, "m.json");
    let expected = serde_json::json!({"name": "r_0", "psnr": null, "ssim": 1.0});
    assert_eq!((&record["pairs"][0], &record["mean"]["psnr"]), (&expected, &Value::Null));
    let ran = place.done("metrics images/r_0.png images/r_0.png");
    let last: Vec<&str> = ran.out.lines().last().unwrap().split_whitespace().collect();
    assert_eq!(last, ["mean", "inf", "1.0000", "0.0000"]);
}

/// If this failed, renders with an alpha channel would be judged by invisible colours.
#[test]
fn transparent_pixels_are_laid_over_the_background() {
    let place = Place::new();
    let pixel = |x: u32, y: u32| image::Rgba([200, (5 * x) as u8, (3 * y) as u8, (6 * x + y) as u8]);
    image::RgbaImage::from_fn(40, 15, pixel).save(place.path("a.png")).unwrap();
    for (background, colour) in [("black", 0.0), ("white", 255.0)] {
        let laid = |x, y| {
            let [r, g, b, alpha] = pixel(x, y).0.map(f64::from);
            let alpha = alpha / 255.0;
            image::Rgb([r, g, b].map(|v| (alpha * v + (1.0 - alpha) * colour).round() as u8))
        };
        image::RgbImage::from_fn(40, 15, laid).save(place.path(&format!("{background}.png"))).unwrap();
    }
    let psnr = |reference: &str, options: &str| {
        place.done(&format!("metrics a.png {reference}.png --lpips none --json m.json {options}"));
        json(&place, "m.json")["mean"]["psnr"].clone()
    };
    assert_eq!(psnr("black", ""), Value::Null, "black is the default");
    assert_eq!(psnr("black", "--background black"), Value::Null);
    assert_eq!(psnr("white", "--background white"), Value::Null);
    assert!(psnr("white", "").as_f64().unwrap() < 20.0);
}

/// If this failed, the same images would get other figures on another machine, or stages race. (On other drivers than
/// lavapipe the variables are not read, and this is the same run again.)
#[test]
fn figures_do_not_depend_on_threads_or_subgroups() {
    let (place, _) = place();
    let measured = |name: &str, value: &str| {
        let arguments = "metrics images reference --json m.json";
        let ran = ended(place.command(arguments).env(name, value).output().unwrap());
        assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""), "{name}={value}");
        place.read("m.json")
    };
    let first = measured("LP_NUM_THREADS", "2");
    assert_eq!(first, measured("LP_NUM_THREADS", "0"));
    assert_eq!(first, measured("LP_NUM_THREADS", "1"));
    for bits in ["128", "512"] {
        assert_eq!(first, measured("LP_NATIVE_VECTOR_WIDTH", bits), "vectors of {bits} bits");
    }
    assert_eq!(first, measured("CAMSPLAT_VALIDATION", "1"));
}

/// If this failed, weights that a user names would not be those that are used.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn weights_come_from_files_and_the_environment() {
    let data = data_folder().join("lpips");
    let place = Place::new();
    let file = |name: &str| data.join(name).display().to_string();
    let (a, b) = (file("apple.png"), file("pear.png"));
    let (alex, vgg) = (file("lpips_alex.safetensors"), file("lpips_vgg16_f16.safetensors"));
    place.done(&format!("metrics {a} {b} --lpips both --lpips-alex {alex} --lpips-vgg {vgg} --json both.json"));
    let mut command = place.command(&format!("metrics {a} {b} --lpips vgg --json vgg.json"));
    assert_eq!(ended(command.env("CAMSPLAT_LPIPS_VGG", vgg).output().unwrap()).code, Some(0));
    let (both, alone) = (json(&place, "both.json"), json(&place, "vgg.json"));
    assert!((both["mean"]["lpips_alex"].as_f64().unwrap() - 0.501_159).abs() < 1e-5, "{both}");
    assert!((both["mean"]["lpips_vgg"].as_f64().unwrap() - 0.657_139_6).abs() < 1e-5, "{both}");
    assert_eq!((&alone["mean"]["lpips_vgg"], &alone["mean"]["lpips_alex"]), (&both["mean"]["lpips_vgg"], &Value::Null));
}
