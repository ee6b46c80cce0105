"""Poses of photos by COLMAP's structure from motion, which goes on from where it was.

Standard input has a line of JSON: `images`, the folder of the photos; `work`, a folder for database and model; `lenses`, for each photo by
name the lens that took it; `checksums`, for each that of its file. The model goes to `work`/sparse/0; the last line that is printed is JSON
with the photos that have a pose. It ends where its input is closed, and may be killed at any time: what is in `work` stays sound, or is
made anew.
"""

import json
import os
import shutil
import sys
import threading

import pycolmap

# All are posed anew where more than a share of them has no pose, and there are so many times as many as at the last time.
LEFT, GROWN = 0.2, 1.5
# Longest side, in pixels, of photos in which features are looked for.
SIDE = 1600


def main() -> None:
    request = json.loads(sys.stdin.readline())
    threading.Thread(target=end_with_input, daemon=True).start()
    pycolmap.logging.minloglevel = 3
    work, checksums = request["work"], request["checksums"]
    os.makedirs(work, exist_ok=True)
    seen = read(os.path.join(work, "checksums.json"), {})
    if any(checksums.get(name, before) != before for name, before in seen.items()):
        # A photo has been replaced by another of its name.
        clear(work)
    write(os.path.join(work, "checksums.json"), {**seen, **checksums})
    try:
        found = register(request["images"], work, request["lenses"])
    except Exception:
        # Of a database or model that is damaged.
        clear(work)
        found = register(request["images"], work, request["lenses"])
    print(json.dumps({"posed": sorted(found)}))


def end_with_input() -> None:
    sys.stdin.read()
    os._exit(1)


def clear(work: str) -> None:
    shutil.rmtree(os.path.join(work, "sparse"), ignore_errors=True)
    for name in os.listdir(work):
        if name.startswith("database.db"):
            os.remove(os.path.join(work, name))


def register(images: str, work: str, lenses: dict) -> set:
    """Poses as many of the photos as can be had, and returns their names."""
    database, model, last = (os.path.join(work, name) for name in ("database.db", "sparse/0", "anew.json"))
    if os.path.isdir(model + ".old") and not os.path.isdir(model):
        os.rename(model + ".old", model)
    extract(database, images, lenses)
    pycolmap.match_exhaustive(database)
    before = model if os.path.isdir(model) else ""
    best = mapped(database, images, work, lenses, before)
    if before and len(posed(best)) < (1 - LEFT) * len(lenses) and len(lenses) >= GROWN * read(last, 0):
        anew = mapped(database, images, work, lenses, "")
        best = max(best, anew, key=lambda found: len(posed(found)))
        write(last, len(lenses))
    elif not before:
        write(last, len(lenses))
    if posed(best):
        keep(best, model)
    return posed(best) & set(lenses)


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


def read(file: str, otherwise):
    try:
        with open(file, encoding="utf-8") as opened:
            return type(otherwise)(json.load(opened))
    except (OSError, ValueError, TypeError):
        return otherwise


def write(file: str, what) -> None:
    with open(file + ".new", "w", encoding="utf-8") as opened:
        json.dump(what, opened)
    os.replace(file + ".new", file)


main()
