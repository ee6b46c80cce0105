use std::path::PathBuf;

use image::{ImageFormat, Rgb, RgbImage, Rgba, RgbaImage};
use tempfile::TempDir;

use super::*;
use crate::files::photos::Photo;
use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::scene::lens::Distortion;

fn photo(path: PathBuf, width: u32, height: u32) -> Photo {
    let pose = Pose::looking(glam::DVec3::ZERO, glam::DVec3::Z, glam::DVec3::Y);
    let camera = Camera {
        name: path.file_name().unwrap().to_string_lossy().into_owned(),
        pose,
        intrinsics: Intrinsics::from_fov(width, height, 1.0),
    };
    Photo { camera, distortion: Distortion::default(), image: Some(path), mask: None }
}

/// `count` photos of several sizes, as PNG and JPEG, that differ in every pixel.
fn photos(folder: &TempDir, count: u32) -> Vec<Photo> {
    (0..count)
        .map(|i| {
            let (width, height) = (40 + 37 * (i % 4), 30 + 11 * (i % 3));
            let pixel = |x: u32, y: u32| Rgb([(x * 7 + i) as u8, (y * 5 + 3 * i) as u8, (x * y + i) as u8]);
            let path = folder.path().join(format!("{i:03}.{}", if i % 2 == 0 { "png" } else { "jpg" }));
            RgbImage::from_fn(width, height, pixel).save(&path).unwrap();
            photo(path, width, height)
        })
        .collect()
}

fn single(decoded: &Decoded) -> &[f32] {
    match &decoded.values {
        Values::Single(values) => values,
        _ => panic!("not single precision"),
    }
}

/// If this failed, results would depend on how many cores a machine has, or photos be mistaken for each other.
#[test]
fn order_and_bits_do_not_depend_on_threads() {
    let folder = tempfile::tempdir().unwrap();
    let photos = photos(&folder, 25);
    for (channels, precision, shrink) in [
        (Channels::Rgb, Precision::Single, 1),
        (Channels::Luma, Precision::Half, 1),
        (Channels::Rgb, Precision::Half, 3),
        (Channels::Rgb, Precision::Byte, 2),
    ] {
        let decode = |threads, memory| -> Vec<Decoded> {
            let settings = DecodeSettings { channels, precision, shrink, memory, threads };
            Decoder::new(&photos, settings).unwrap().map(Result::unwrap).collect()
        };
        let one = decode(1, 1 << 30);
        assert!(one.iter().enumerate().all(|(i, decoded)| decoded.index == i) && one.len() == 25);
        assert!(
            one == decode(2, 1 << 30) && one == decode(7, 1 << 30) && one == decode(7, 1) && one == decode(0, 200_000)
        );
    }
}

/// If this failed, thousands of photos would fill the memory while their consumer is busy.
#[test]
fn the_budget_holds() {
    let folder = tempfile::tempdir().unwrap();
    let photos = photos(&folder, 30);
    let settings = DecodeSettings { threads: 4, ..DecodeSettings::default() };
    let most = |memory, patience: u64| {
        let mut decoder = Decoder::new(&photos, DecodeSettings { memory, ..settings }).unwrap();
        assert_eq!(decoder.len(), 30);
        let mut count = 0;
        for decoded in decoder.by_ref() {
            decoded.unwrap();
            count += 1;
            std::thread::sleep(std::time::Duration::from_millis(patience));
        }
        assert_eq!(count, 30);
        decoder.most_in_flight()
    };
    let bytes = |photo: &Photo| {
        let Intrinsics { width, height, .. } = photo.camera.intrinsics;
        pixels::estimate(photo).unwrap() + settings.result_bytes(width, height)
    };
    let largest = photos.iter().map(bytes).max().unwrap();
    for memory in [largest, 2 * largest, 5 * largest] {
        let most = most(memory, 2);
        assert!(most <= memory && most > memory / 3, "{most} of {memory} bytes");
    }
    // One that is larger than the budget goes alone.
    assert_eq!(most(1, 0), largest);
}

/// If this failed, what is made of photos would come in another order, on the consumer's thread, or past the budget.
#[test]
fn what_is_made_of_photos_comes_in_their_order_and_within_the_budget() {
    let folder = tempfile::tempdir().unwrap();
    let photos = photos(&folder, 30);
    let settings =
        DecodeSettings { precision: Precision::Byte, memory: 200_000, threads: 3, ..DecodeSettings::default() };
    let make = |photo: &Photo, decoded: Decoded| {
        assert_ne!(decoded.index, 7, "for the test");
        Ok((photo.camera.name.clone(), decoded.width, std::thread::current().id()))
    };
    let mut decoder = Decoder::making(&photos, settings, 2, make).unwrap();
    let all: Vec<_> = decoder.by_ref().collect();
    for (i, (photo, made)) in photos.iter().zip(all).enumerate() {
        match made {
            Ok((name, width, thread)) => {
                assert_eq!((name, width), (photo.camera.name.clone(), photo.camera.intrinsics.width));
                assert_ne!(thread, std::thread::current().id());
            }
            Err(error) => assert!(i == 7 && error.to_string().contains("007.jpg"), "{error}"),
        }
    }
    assert!(decoder.most_in_flight() <= settings.memory);
}

/// If this failed, a user who presses Ctrl-C would wait for thousands of photos, or threads would outlive their work.
#[test]
fn dropping_ends_the_threads() {
    let folder = tempfile::tempdir().unwrap();
    let photos = photos(&folder, 200);
    for memory in [1, 100_000, 1 << 30] {
        let mut decoder =
            Decoder::new(&photos, DecodeSettings { memory, threads: 3, ..DecodeSettings::default() }).unwrap();
        assert_eq!(decoder.next().unwrap().unwrap().index, 0);
        let queue = Arc::clone(&decoder.queue);
        drop(decoder);
        assert_eq!(Arc::strong_count(&queue), 1);
    }
}

/// If this failed, a damaged photo would be silently decoded to grey, or spoil the photos after it.
#[test]
fn faults_name_their_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut photos = photos(&folder, 6);
    for i in [0, 1] {
        let path = photos[i].image.clone().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() * 3 / 4]).unwrap();
    }
    photos[2].camera.intrinsics.width = 7;
    photos[3].image = None;
    photos[4].mask = Some(folder.path().join("none.png"));
    let all: Vec<Result<Decoded>> = Decoder::new(&photos, DecodeSettings::default()).unwrap().collect();
    let message = |i: usize| all[i].as_ref().unwrap_err().to_string();
    for (i, fragment) in [(0, "cannot be decoded"), (1, "cut short"), (2, "its camera 7 x"), (3, "no image file")] {
        let name = format!("{i:03}.");
        assert!(message(i).contains(&name) && message(i).contains(fragment), "{}", message(i));
    }
    assert!(message(4).contains("none.png"), "{}", message(4));
    assert!(all[5].is_ok());
}

/// If this failed, a header that announces more than memory holds would crash the program where a mask is stretched to its size.
#[test]
fn a_header_that_announces_too_much_is_refused_before_its_mask() {
    let folder = tempfile::tempdir().unwrap();
    let (path, mask) = (folder.path().join("a.png"), folder.path().join("mask.png"));
    RgbImage::new(8, 8).save(&path).unwrap();
    image::GrayImage::new(8, 8).save(&mask).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    // Width, height, and the checksum of the chunk that holds them (CRC-32).
    bytes[16..24].copy_from_slice(&[200_000u32.to_be_bytes(), 200_000u32.to_be_bytes()].concat());
    let step = |crc: u32, _| (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 };
    let crc = !bytes[12..29].iter().fold(u32::MAX, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step));
    bytes[29..33].copy_from_slice(&crc.to_be_bytes());
    std::fs::write(&path, bytes).unwrap();
    let photos = [Photo { mask: Some(mask), ..photo(path, 200_000, 200_000) }];
    let decoded = Decoder::new(&photos, DecodeSettings::default()).unwrap().next().unwrap();
    let error = decoded.err().unwrap().to_string();
    assert!(error.contains("a.png") && error.contains("200000 x 200000 pixels are too many"), "{error}");
}

/// Computed directly. If this failed, intensities would be compared that are not proportional to light.
#[test]
fn values_are_linear() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let mut image = RgbImage::new(5, 3);
    image.put_pixel(0, 0, Rgb([255, 188, 0]));
    image.put_pixel(1, 1, Rgb([255, 255, 255]));
    image.save(&path).unwrap();
    let photos = [photo(path, 5, 3)];
    let decode = |settings| Decoder::new(&photos, settings).unwrap().next().unwrap().unwrap();
    // (188/255 + 0.055)/1.055 to the 2.4 is 0.5029.
    let rgb = decode(DecodeSettings::default());
    assert_eq!((rgb.width, rgb.height, single(&rgb).len()), (5, 3, 45));
    assert!((single(&rgb)[1] - 0.5029).abs() < 1e-4 && single(&rgb)[0] == 1.0 && single(&rgb)[2] == 0.0);
    assert_eq!(rgb.mask, None);
    let luma = decode(DecodeSettings { channels: Channels::Luma, ..DecodeSettings::default() });
    assert!((single(&luma)[0] - (0.2126 + 0.7152 * 0.5029)).abs() < 1e-4, "{:?}", single(&luma));
    let small = decode(DecodeSettings { shrink: 2, ..DecodeSettings::default() });
    assert_eq!((small.width, small.height, single(&small).len()), (2, 1, 6));
    assert!((single(&small)[0] - 0.5).abs() < 1e-6 && (single(&small)[1] - 1.5029 / 4.0).abs() < 1e-4);
    let half = decode(DecodeSettings { precision: Precision::Half, ..DecodeSettings::default() });
    let Values::Half(values) = &half.values else { panic!("single precision") };
    assert_eq!(values[1], f16::from_f32(single(&rgb)[1]));
    let byte =
        |shrink| decode(DecodeSettings { precision: Precision::Byte, shrink, ..DecodeSettings::default() }).values;
    let Values::Byte(values) = byte(1) else { panic!("not bytes") };
    assert_eq!(values, image.into_raw());
    // A linear 1.5029 / 4 is 164.9 of 255 in sRGB, and a quarter 137.0.
    let Values::Byte(values) = byte(2) else { panic!("not bytes") };
    assert_eq!(values[..3], [188, 165, 137]);
    assert_eq!(byte(1).into_linear(), single(&rgb));
    for values in [rgb.values, half.values] {
        assert_eq!(values.into_bytes(), byte(1).into_bytes());
    }
}

/// If this failed, background would be taken for the object, or darken its border.
#[test]
fn alpha_and_mask_files_cover_the_object() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let mut image = RgbaImage::new(4, 2);
    image.put_pixel(0, 0, Rgba([255, 255, 255, 255]));
    image.put_pixel(1, 0, Rgba([255, 255, 255, 128]));
    image.save(&path).unwrap();
    let mut photos = [photo(path, 4, 2)];
    let decode = |photos: &[Photo], shrink| {
        Decoder::new(photos, DecodeSettings { shrink, ..DecodeSettings::default() }).unwrap().next().unwrap().unwrap()
    };
    let whole = decode(&photos, 1);
    assert_eq!(whole.mask.as_deref(), Some(&[255, 128, 0, 0, 0, 0, 0, 0][..]));
    assert_eq!(single(&whole)[3], 1.0);
    let small = decode(&photos, 2);
    // (255 + 128) / 4 covered; the part that is covered is white.
    assert_eq!(small.mask.as_deref(), Some(&[96, 0][..]));
    assert_eq!(single(&small), [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    // A mask file takes precedence over alpha; it may be of half the size, and of 16 bits.
    let mask = folder.path().join("mask.png");
    image::ImageBuffer::<image::Luma<u16>, _>::from_raw(2, 1, vec![0u16, 65_535])
        .unwrap()
        .save_with_format(&mask, ImageFormat::Png)
        .unwrap();
    photos[0].mask = Some(mask);
    assert_eq!(decode(&photos, 1).mask.as_deref(), Some(&[0, 0, 255, 255, 0, 0, 255, 255][..]));
}

/// If this failed, metrics would be taken of other colours than a viewer shows: of grey images, of 16 bits, of transparent ones.
#[test]
fn encoded_colours_are_those_stored_over_the_background() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let pixels = |background: u8| encoded(&path, [background, 0, background]).unwrap().pixels;
    RgbImage::from_pixel(2, 1, Rgb([1, 2, 253])).save(&path).unwrap();
    assert_eq!(pixels(255), [1, 2, 253, 1, 2, 253]);
    image::GrayAlphaImage::from_pixel(1, 1, image::LumaA([100, 51])).save(&path).unwrap();
    assert_eq!((pixels(0), pixels(255)), (vec![20; 3], vec![224, 20, 224]));
    let wide = image::ImageBuffer::<Rgba<u16>, _>::from_pixel(1, 1, Rgba([65_535, 257 * 7 + 128, 0, 65_535]));
    wide.save(&path).unwrap();
    assert_eq!(pixels(255), [255, 7, 0]);
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() - 30]).unwrap();
    assert!(encoded(&path, [0; 3]).unwrap_err().to_string().contains("cannot be decoded"));
}
