"""Poses of photos by COLMAP's structure from motion, which goes on from where it was.

Standard input has a line of JSON: `work`, a folder for database and model; `photos`, in the order in which they were taken: name, file, the
lens that took it, and the checksum of the file. The model goes to `work`/sparse/0; the last line that is printed is JSON with the photos
that have a pose. It ends where its input is closed, and may be killed at any time: what is in `work` stays sound, or is made anew.
"""

import json
import os
import shutil
import sys
import threading
import zipfile

import numpy
import pycolmap

# All are posed anew where more than a share of them has no pose, and there are so many times as many as at the last time.
LEFT, GROWN = 0.2, 1.5
# So many photos are matched with all others; where there are more, with so many that were taken before, and so many that look most like it.
ALL, BEFORE, ALIKE = 60, 10, 20
# Words by which photos are found alike, and features of a photo that are asked.
WORDS, ASKED = 64, 1000
# Longest side, in pixels, of photos in which features are looked for.
SIDE = 1600


def main() -> None:
    request = json.loads(sys.stdin.readline())
    threading.Thread(target=end_with_input, daemon=True).start()
    pycolmap.logging.minloglevel = 3
    work, photos = request["work"], request["photos"]
    lenses = {name: lens for name, _, lens, _ in photos}
    checksums = {name: checksum for name, _, _, checksum in photos}
    images = os.path.join(work, "images")
    if not os.path.isdir(os.path.dirname(work)):
        # What a user has moved away is not made again.
        sys.exit(f"{os.path.dirname(work)} is gone")
    os.makedirs(work, exist_ok=True)
    link(images, {name: file for name, file, _, _ in photos})
    seen = read(os.path.join(work, "checksums.json"), {})
    if any(checksums.get(name, before) != before for name, before in seen.items()):
        # A photo has been replaced by another of its name.
        clear(work)
    write(os.path.join(work, "checksums.json"), {**seen, **checksums})
    try:
        found = register(images, work, lenses)
    except Exception:
        # Of a database or model that is damaged.
        clear(work)
        found = register(images, work, lenses)
    print(json.dumps({"posed": sorted(found)}))


def end_with_input() -> None:
    sys.stdin.read()
    os._exit(1)


def link(folder: str, files: dict) -> None:
    """One folder with all photos, as COLMAP needs it: they may lie in several."""
    for root, _, names in os.walk(folder):
        for name in names:
            at = os.path.join(root, name)
            if not is_linked(at, files.get(os.path.relpath(at, folder).replace(os.sep, "/"))):
                os.remove(at)
    for name, file in files.items():
        at = os.path.join(folder, name)
        if os.path.lexists(at):
            continue
        os.makedirs(os.path.dirname(at), exist_ok=True)
        try:
            os.symlink(file, at)
        except OSError:
            # Where the system allows no links.
            shutil.copy2(file, at)


def is_linked(at: str, file) -> bool:
    """Whether what is there is the link to the file, or a copy of it."""
    if file is None or os.path.islink(at):
        return file is not None and os.readlink(at) == file
    try:
        copy, own = os.stat(at), os.stat(file)
    except OSError:
        return False
    # Some file systems keep times to two seconds.
    return copy.st_size == own.st_size and abs(copy.st_mtime - own.st_mtime) <= 2


def clear(work: str) -> None:
    shutil.rmtree(os.path.join(work, "sparse"), ignore_errors=True)
    for name in os.listdir(work):
        if name.startswith("database.db") or name == "alike.npz":
            os.remove(os.path.join(work, name))


def register(images: str, work: str, lenses: dict) -> set:
    """Poses as many of the photos as can be had, and returns their names."""
    database, model, last = (os.path.join(work, name) for name in ("database.db", "sparse/0", "anew.json"))
    if os.path.isdir(model + ".old") and not os.path.isdir(model):
        os.rename(model + ".old", model)
    extract(database, images, lenses)
    match(database, work, list(lenses))
    before = model if os.path.isdir(model) else ""
    best = mapped(database, images, work, lenses, before)
    if before and len(posed(best)) < (1 - LEFT) * len(lenses) and len(lenses) >= GROWN * read(last, 0):
        anew = mapped(database, images, work, lenses, "")
        best = max(best, anew, key=lambda found: len(posed(found)))
        write(last, len(lenses))
    elif not before:
        write(last, len(lenses))
    if posed(best) and os.path.isdir(work):
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


def match(database: str, work: str, names: list) -> None:
    """Matches photos, given in the order in which they were taken; pairs that were matched before are not matched again."""
    # A list of pairs has names between spaces.
    if len(names) <= ALL or any(name.split() != [name] or name.startswith("#") for name in names):
        pycolmap.match_exhaustive(database)
        return
    alike = signatures(database, os.path.join(work, "alike.npz"), names)
    names = [name for name in names if name in alike]
    likeness = numpy.stack([alike[name] for name in names])
    likeness = likeness @ likeness.T
    pairs = set()
    for i, row in enumerate(likeness):
        others = [*range(max(0, i - BEFORE), i), *numpy.argsort(-row)[: ALIKE + 1]]
        pairs |= {(min(i, j), max(i, j)) for j in others if j != i}
    options = pycolmap.ImportedPairingOptions()
    options.match_list_path = os.path.join(work, "pairs.txt")
    with open(options.match_list_path, "w", encoding="utf-8") as opened:
        opened.writelines(f"{names[i]} {names[j]}\n" for i, j in sorted(pairs))
    pycolmap.match_image_pairs(database, pairing_options=options)


def signatures(database: str, file: str, names: list) -> dict:
    """By photo a unit vector that is like those of photos that show the same (VLAD, Jegou and others 2010). Words are features of the first
    photos, and stay, so that what an earlier call found holds."""
    try:
        with numpy.load(file) as opened:
            known = dict(opened)
    except (OSError, ValueError, EOFError, zipfile.BadZipFile):
        known = {}
    words = known.pop(" words", None)
    with pycolmap.Database.open(database) as opened:
        ids = {image.name: image.image_id for image in opened.read_all_images()}

        def features(name):
            # The largest come last.
            return opened.read_descriptors(ids[name]).data[-ASKED:].astype(numpy.float32) / 512

        having = [name for name in names if name in ids and len(features(name)) > 0]
        if words is None:
            known = {}
            some = numpy.concatenate([features(name) for name in having[:ALL]])
            words = some[numpy.random.default_rng(0).permutation(len(some))[:WORDS]]
        for name in having:
            if name not in known:
                found = features(name)
                word = numpy.argmax(found @ words.T, axis=1)
                sums = numpy.zeros(words.shape, numpy.float32)
                numpy.add.at(sums, word, found - words[word])
                sums = numpy.sign(sums) * numpy.sqrt(numpy.abs(sums))
                known[name] = (sums / max(float(numpy.linalg.norm(sums)), 1e-9)).ravel()
    known = {name: known[name] for name in having}
    with open(file + ".new", "wb") as opened:
        numpy.savez(opened, **{" words": words}, **known)
    os.replace(file + ".new", file)
    return known


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


if __name__ == "__main__":
    main()
