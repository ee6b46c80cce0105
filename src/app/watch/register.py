"""Poses of photos by COLMAP's structure from motion, which goes on from where it was.

Standard input has one JSON object: `images`, the folder of the photos; `work`, a folder for database and model; `lenses`, for each photo by
name the lens that took it. The model goes to `work`/sparse/0; the last line that is printed is JSON with the photos that have a pose.
It may be killed at any time: what is in `work` stays sound.
"""

import json
import os
import shutil
import sys

import pycolmap

# All are posed anew where more than a share of them has no pose, and there are so many times as many as at the last time.
LEFT, GROWN = 0.2, 1.5
# Longest side, in pixels, of photos in which features are looked for.
SIDE = 1600


def main() -> None:
    request = json.load(sys.stdin)
    images, work, lenses = request["images"], request["work"], request["lenses"]
    pycolmap.logging.minloglevel = 3
    os.makedirs(work, exist_ok=True)
    database, model, last = (os.path.join(work, name) for name in ("database.db", "sparse/0", "anew.json"))
    if os.path.isdir(model + ".old") and not os.path.isdir(model):
        os.rename(model + ".old", model)
    extract(database, images, lenses)
    pycolmap.match_exhaustive(database)
    before = model if os.path.isdir(model) else ""
    best = mapped(database, images, work, lenses, before)
    if before and len(posed(best)) < (1 - LEFT) * len(lenses) and len(lenses) >= GROWN * read(last):
        anew = mapped(database, images, work, lenses, "")
        best = max(best, anew, key=lambda found: len(posed(found)))
        write(last, len(lenses))
    elif not before:
        write(last, len(lenses))
    if posed(best):
        keep(best, model)
    print(json.dumps({"posed": sorted(posed(best) & set(lenses))}))


def extract(database: str, images: str, lenses: dict) -> None:
    """Features of photos that have none yet; photos of one lens share a camera."""
    cameras, known = {}, set()
    with pycolmap.Database.open(database) as opened:
        for image in opened.read_all_images():
            if image.name in lenses:
                cameras[lenses[image.name]] = image.camera_id
            if opened.exists_descriptors(image.image_id):
                known.add(image.name)
    for lens in sorted(set(lenses.values())):
        new = sorted(name for name, of in lenses.items() if of == lens and name not in known)
        if not new:
            continue
        reader = pycolmap.ImageReaderOptions()
        reader.camera_model = "SIMPLE_RADIAL"
        if lens in cameras:
            reader.existing_camera_id = cameras[lens]
        extraction = pycolmap.FeatureExtractionOptions()
        extraction.max_image_size = SIDE
        pycolmap.extract_features(database, images, new, pycolmap.CameraMode.SINGLE, reader, extraction)


def mapped(database: str, images: str, work: str, lenses: dict, before: str):
    """The model with the most photos, grown from the one in the folder `before`; None where there is none."""
    options = pycolmap.IncrementalPipelineOptions()
    options.random_seed = 0
    options.min_model_size = 3
    options.multiple_models = not before
    options.image_names = sorted(lenses)
    new = os.path.join(work, "new")
    shutil.rmtree(new, ignore_errors=True)
    os.makedirs(new)
    found = pycolmap.incremental_mapping(database, images, new, options, before)
    return max(found.values(), key=lambda model: model.num_reg_images(), default=None)


def posed(model) -> set:
    return set() if model is None else {image.name for image in model.images.values() if image.has_pose}


def keep(model, folder: str) -> None:
    """Writes the model in place of the one that is there; one of the two is whole at all times."""
    shutil.rmtree(folder + ".new", ignore_errors=True)
    os.makedirs(folder + ".new")
    model.write(folder + ".new")
    shutil.rmtree(folder + ".old", ignore_errors=True)
    if os.path.isdir(folder):
        os.rename(folder, folder + ".old")
    os.rename(folder + ".new", folder)
    shutil.rmtree(folder + ".old", ignore_errors=True)


def read(file: str) -> int:
    try:
        with open(file, encoding="utf-8") as opened:
            return int(json.load(opened))
    except (OSError, ValueError):
        return 0


def write(file: str, number: int) -> None:
    with open(file, "w", encoding="utf-8") as opened:
        json.dump(number, opened)


main()
