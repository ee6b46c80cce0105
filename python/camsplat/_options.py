"""Options of commands as keywords. Generated: `CAMSPLAT_WRITE_REFERENCE=1 cargo test --release --test reference`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, TypedDict, Union

import numpy.typing as npt

if TYPE_CHECKING:
    from ._cameras import Cameras, Scene
    from ._plan import Plan

File = Union[str, os.PathLike[str]]
Numbers = Sequence[float]


class PlanOptions(TypedDict, total=False):
    """Options of `camsplat plan`."""

    surface: Scene
    """Surface to plan for instead of the capture's own points, in its frame, such as one that `camsplat proxy` made"""

    force: bool
    """Write into a folder that is not empty; files of the same names are replaced, all others stay"""

    preset: Literal["object", "room"]
    """Kind of scene: an object seen from around it, or a room seen from inside [default: room with --box, else object]"""

    shell: Numbers
    """Region of the cameras between two spheres: centre and radii CX,CY,CZ,RMIN,RMAX"""

    box: Numbers
    """Region of the cameras in a box: corners X0,Y0,Z0,X1,Y1,Z1"""

    floor: Union[float, str]
    """Cameras stay at or above this height along --up; `auto` finds what an object stands on below all photos of a capture, `none` is no floor"""

    up: str
    """Up direction: x, -x, +y, ... [default: the photos' own for captures, +y for glTF, as the ground of an OBJ shows it, else +z]"""

    clearance: float
    """Minimum distance between cameras and the surface [default: a twentieth of the object's radius or of the room's smallest side]"""

    keep_out: Union[File, Sequence[File]]
    """Keep cameras and viewers out of a volume, which itself blocks no view: a closed mesh (.obj, .glb, .gltf, .ply), boxes, .json with {"boxes": [[X0,Y0,Z0,X1,Y1,Z1], ...]}, or, at all heights, polygons of GeoJSON or KML (needs --geo); repeatable"""

    wall: Union[Numbers, Sequence[Numbers]]
    """Keep cameras and viewers on one side of a plane, given by a point and the direction to the free side; repeatable; `none` leaves out the walls that points and photos of a capture show"""

    heights: Numbers
    """Restrict cameras to heights that a tripod or drone reaches: coordinates along --up, not distances from the floor"""

    walk: Numbers
    """Restrict cameras to level ground that a person or robot of this radius and height can walk to from a start: coordinates of the feet on open floor, in the frame of the surface"""

    space: str
    """Where cameras and viewers can be: `known`, where the photos of a capture prove it, connected with where they were taken; `open`, wherever nothing is known to be; the inside of a closed mesh or of boxes (as for --keep-out), or the space of a plan.json [default: known for captures, else open; of `next` and `watch` open around an object, and known as far as photos see in a room]"""

    reach: float
    """How far from the nearest photo known space reaches, half of it up or down [default: two of a photographer's steps, as the spacing of the photos shows them]"""

    geo: str
    """Where the scene lies on Earth, for polygons of --keep-out: LAT,LON,ALT[,HEADING] of its origin, utm:ZONE[,EAST,NORTH[,ALT]], ecef, or a capture with GPS, as for `export`"""

    subject: str
    """What of the surface is to be seen, where it holds more: a box X0,Y0,Z0,X1,Y1,Z1, a closed mesh or boxes as for --keep-out, a mesh that is a part of the surface, or `largest`, the largest thing that stands on the ground; the rest blocks views, and its ground is the floor [default: all of the surface]"""

    margin: float
    """Metres that cameras and the tour keep from polygons of --keep-out: GPS drifts [default: 3]"""

    fov: float
    """Horizontal field of view in degrees [default: that of the capture or of the cameras to keep, else 50]"""

    size: tuple[int, int]
    """Image size in pixels [default: that of the capture or of the cameras to keep, else 800x800]"""

    viewers: Union[File, Cameras, Plan, npt.ArrayLike]
    """Where the trained model will be viewed from: shell:CX,CY,CZ,RMIN,RMAX; box:X0,Y0,Z0,X1,Y1,Z1; cone:DEGREES,X,Y,Z, the default within a cone around this direction; heights:LOW,HIGH, the default between these; or a file or folder of cameras [default: around an object, between half of the region's outer radius and all of it; in rooms, anywhere; with `select`, where the photos were taken]"""

    keep: Union[File, Cameras, Plan, npt.ArrayLike]
    """Existing cameras (COLMAP or NSVF folder, transforms.json, plan.json or .log): they count and are never moved"""

    connect: float
    """Place the cameras so that structure from motion can join their photos to each other and to those of --keep: neighbours share surface and see it at no wider an angle between them than this, in degrees, such as 20"""

    order: Literal["tour", "none"]
    """Order of the planned cameras: a short tour that keeps the clearance, or as they were placed [default: tour; none with --method paper-iterative and baselines, whose first cameras are a plan of fewer]"""

    device: Union[str, int]
    """Device, by index or part of its name (see `camsplat devices`) [default: the best]"""

    debug_sync: bool
    """Wait after every stage, so that a device-lost error names the stage that failed; no effect while stages are timed"""

    profile: bool
    """Print GPU time per stage"""

    trace: File
    """Write a trace of host and GPU time that Perfetto opens"""

    renderdoc: File
    """Capture one iteration with RenderDoc into FILE_*.rdc"""

    method: Literal["ours", "paper", "paper-no-vds", "paper-iterative", "ours-two-passes", "random", "fibonacci", "grid", "rings", "fvs", "fvs-chord", "fvs-shared", "coverage", "greedy", "acp", "acp-hidden", "fisherrf", "pop-d", "pop-t", "fisherrf-retrain", "cover", "manifold"]
    """How to place the cameras"""

    candidates: int
    """Random poses that a method chooses from [default: fvs, fvs-chord: 10000; fvs-shared, coverage, greedy: 2000; acp, acp-hidden: 1000; fisherrf, pop-d, pop-t, cover: 300, or three per view]"""

    nodes: int
    """Nodes of the grid along a side [acp, acp-hidden; default: 32]"""

    renders: int
    """Perturbed renderings of a view in an ascent step [manifold; default: 2]"""

    steps: int
    """Ascent steps of each camera [manifold; default: 401]"""

    look_size: int
    """Longer side of the pictures that are compared, in pixels at most [manifold; default: 128]"""

    noise_steps: int
    """Steps of learning the model's noise before the first camera is placed [manifold; default: 200]"""

    model: File
    """Trained splats of the scene (.ply, .spz, .sog, .splat, .glb) in the frame of the cameras, for methods that need them"""

    antialiased: bool
    """The model was trained with antialiasing [default: as its file says]"""

    seed: int
    """Seed of every random number"""

    iterations: int
    """Iterations [default: 100; in rooms 600; with --method paper 1000]"""

    probes: int
    """Viewers per iteration; with --method paper point cameras [default: 20]"""

    gate: Literal["hard", "soft", "pinhole", "pinhole-hard"]
    """Field-of-view test while optimising [default: pinhole; with --method paper soft]"""

    gate_softness: float
    """Softness of the gate, in cosines (cone) or sines (pinhole) [default: 0.01; with --method paper 0.02]"""

    lambda_bound: float
    """Weight of the region term [default: 10]"""

    lr_position: float
    """Learning rate of positions, in radii of the region [default: 0.015; with --method paper 0.0065]"""

    lr_direction: float
    """Learning rate of directions [default: 0.05; with --method paper 0.02]"""

    held_out: int
    """Surface points for the geometric metrics, apart from those that are planned for [default: 1000]"""

    checkpoint_every: int
    """Iterations between checkpoints of the metrics [default: 50]"""

    pool: int
    """Point cameras in all, from which each step takes the next few"""

    resolution: int
    """Texels of a point camera along a side, a multiple of 8 [default: by the scale]"""

    kernel: Literal["angular", "metric"]
    """Kernel of the splats"""

    alpha: float
    """Opacity of a splat"""

    no_occlusion: bool
    """Ignore occlusion"""

    equal_directions: bool
    """Weight every direction of a point camera equally in the image term, as the paper does, instead of every point camera"""

    lambda_reg: float
    """Weight of the coverage regulariser"""

    lambda_scale: float
    """Pressure on the square of the scale"""

    lr_scale: float
    """Learning rate of the scale's logarithm; 0 holds it where it starts"""

    scale: float
    """Scale of the splats at the start, in radians [default: by the number of splats that a point camera sees]"""

    relocate_every: int
    """Iterations between relocations of splats that light nothing; 0 for never"""

    start: Literal["random", "identical"]
    """Where the cameras are at first"""

    pass_: Literal["auto", "dense", "binned"]
    """The way through the splat pass"""


class ScoreOptions(TypedDict, total=False):
    """Options of `camsplat score`."""

    preset: Literal["object", "room"]
    """Kind of scene: an object seen from around it, or a room seen from inside [default: room with --box, else object]"""

    shell: Numbers
    """Region of the cameras between two spheres: centre and radii CX,CY,CZ,RMIN,RMAX"""

    box: Numbers
    """Region of the cameras in a box: corners X0,Y0,Z0,X1,Y1,Z1"""

    floor: Union[float, str]
    """Cameras stay at or above this height along --up; `auto` finds what an object stands on below all photos of a capture, `none` is no floor"""

    up: str
    """Up direction: x, -x, +y, ... [default: the photos' own for captures, +y for glTF, as the ground of an OBJ shows it, else +z]"""

    clearance: float
    """Minimum distance between cameras and the surface [default: a twentieth of the object's radius or of the room's smallest side]"""

    keep_out: Union[File, Sequence[File]]
    """Keep cameras and viewers out of a volume, which itself blocks no view: a closed mesh (.obj, .glb, .gltf, .ply), boxes, .json with {"boxes": [[X0,Y0,Z0,X1,Y1,Z1], ...]}, or, at all heights, polygons of GeoJSON or KML (needs --geo); repeatable"""

    wall: Union[Numbers, Sequence[Numbers]]
    """Keep cameras and viewers on one side of a plane, given by a point and the direction to the free side; repeatable; `none` leaves out the walls that points and photos of a capture show"""

    heights: Numbers
    """Restrict cameras to heights that a tripod or drone reaches: coordinates along --up, not distances from the floor"""

    walk: Numbers
    """Restrict cameras to level ground that a person or robot of this radius and height can walk to from a start: coordinates of the feet on open floor, in the frame of the surface"""

    space: str
    """Where cameras and viewers can be: `known`, where the photos of a capture prove it, connected with where they were taken; `open`, wherever nothing is known to be; the inside of a closed mesh or of boxes (as for --keep-out), or the space of a plan.json [default: known for captures, else open; of `next` and `watch` open around an object, and known as far as photos see in a room]"""

    reach: float
    """How far from the nearest photo known space reaches, half of it up or down [default: two of a photographer's steps, as the spacing of the photos shows them]"""

    geo: str
    """Where the scene lies on Earth, for polygons of --keep-out: LAT,LON,ALT[,HEADING] of its origin, utm:ZONE[,EAST,NORTH[,ALT]], ecef, or a capture with GPS, as for `export`"""

    subject: str
    """What of the surface is to be seen, where it holds more: a box X0,Y0,Z0,X1,Y1,Z1, a closed mesh or boxes as for --keep-out, a mesh that is a part of the surface, or `largest`, the largest thing that stands on the ground; the rest blocks views, and its ground is the floor [default: all of the surface]"""

    margin: float
    """Metres that cameras and the tour keep from polygons of --keep-out: GPS drifts [default: 3]"""

    device: Union[str, int]
    """Device, by index or part of its name (see `camsplat devices`) [default: the best]"""

    debug_sync: bool
    """Wait after every stage, so that a device-lost error names the stage that failed; no effect while stages are timed"""

    viewers: Union[File, Cameras, Plan, npt.ArrayLike]
    """Where the trained model will be viewed from: shell:CX,CY,CZ,RMIN,RMAX; box:X0,Y0,Z0,X1,Y1,Z1; cone:DEGREES,X,Y,Z, the default within a cone around this direction; heights:LOW,HIGH, the default between these; or a file or folder of cameras [default: around an object, between half of the region's outer radius and all of it; in rooms, anywhere; with `select`, where the photos were taken]"""

    all: bool
    """Print the geometric metrics too: coverage, angular gaps, Voronoi cells, triangulation, ground sampling"""

    held_out: int
    """Surface points for the geometric metrics"""

    seed: int
    """Seed of viewers, layouts and held-out points"""

    cone: bool
    """Geometric metrics by the cone inscribed in the image, not by the whole image"""


class SelectOptions(TypedDict, total=False):
    """Options of `camsplat select`."""

    force: bool
    """Write into a folder that is not empty; files of the same names are replaced, all others stay"""

    surface: Scene
    """The surface, in the capture's frame, in any format that `camsplat plan` reads [default: the capture's own points]"""

    preset: Literal["object", "room"]
    """Kind of scene: an object seen from around it, or a room seen from inside [default: room with --box, else object]"""

    shell: Numbers
    """Region of the cameras between two spheres: centre and radii CX,CY,CZ,RMIN,RMAX"""

    box: Numbers
    """Region of the cameras in a box: corners X0,Y0,Z0,X1,Y1,Z1"""

    floor: Union[float, str]
    """Cameras stay at or above this height along --up; `auto` finds what an object stands on below all photos of a capture, `none` is no floor"""

    up: str
    """Up direction: x, -x, +y, ... [default: the photos' own for captures, +y for glTF, as the ground of an OBJ shows it, else +z]"""

    clearance: float
    """Minimum distance between cameras and the surface [default: a twentieth of the object's radius or of the room's smallest side]"""

    keep_out: Union[File, Sequence[File]]
    """Keep cameras and viewers out of a volume, which itself blocks no view: a closed mesh (.obj, .glb, .gltf, .ply), boxes, .json with {"boxes": [[X0,Y0,Z0,X1,Y1,Z1], ...]}, or, at all heights, polygons of GeoJSON or KML (needs --geo); repeatable"""

    wall: Union[Numbers, Sequence[Numbers]]
    """Keep cameras and viewers on one side of a plane, given by a point and the direction to the free side; repeatable; `none` leaves out the walls that points and photos of a capture show"""

    heights: Numbers
    """Restrict cameras to heights that a tripod or drone reaches: coordinates along --up, not distances from the floor"""

    walk: Numbers
    """Restrict cameras to level ground that a person or robot of this radius and height can walk to from a start: coordinates of the feet on open floor, in the frame of the surface"""

    space: str
    """Where cameras and viewers can be: `known`, where the photos of a capture prove it, connected with where they were taken; `open`, wherever nothing is known to be; the inside of a closed mesh or of boxes (as for --keep-out), or the space of a plan.json [default: known for captures, else open; of `next` and `watch` open around an object, and known as far as photos see in a room]"""

    reach: float
    """How far from the nearest photo known space reaches, half of it up or down [default: two of a photographer's steps, as the spacing of the photos shows them]"""

    geo: str
    """Where the scene lies on Earth, for polygons of --keep-out: LAT,LON,ALT[,HEADING] of its origin, utm:ZONE[,EAST,NORTH[,ALT]], ecef, or a capture with GPS, as for `export`"""

    subject: str
    """What of the surface is to be seen, where it holds more: a box X0,Y0,Z0,X1,Y1,Z1, a closed mesh or boxes as for --keep-out, a mesh that is a part of the surface, or `largest`, the largest thing that stands on the ground; the rest blocks views, and its ground is the floor [default: all of the surface]"""

    margin: float
    """Metres that cameras and the tour keep from polygons of --keep-out: GPS drifts [default: 3]"""

    viewers: Union[File, Cameras, Plan, npt.ArrayLike]
    """Where the trained model will be viewed from: shell:CX,CY,CZ,RMIN,RMAX; box:X0,Y0,Z0,X1,Y1,Z1; cone:DEGREES,X,Y,Z, the default within a cone around this direction; heights:LOW,HIGH, the default between these; or a file or folder of cameras [default: around an object, between half of the region's outer radius and all of it; in rooms, anywhere; with `select`, where the photos were taken]"""

    fov: float
    """Horizontal field of view in degrees, for a file of poses without lenses"""

    size: tuple[int, int]
    """Image size in pixels, for a file of poses without lenses"""

    method: Literal["ours", "assigned", "nearest", "random", "fibonacci", "fvs", "fvs-chord", "fvs-shared", "coverage", "acp", "acp-hidden", "fisherrf", "pop-d", "pop-t", "fisherrf-retrain", "cover"]
    """How to choose"""

    model: File
    """Trained splats of the scene (.ply, .spz, .sog, .splat, .glb) in the frame of the cameras, for methods that need them"""

    antialiased: bool
    """The model was trained with antialiasing [default: as its file says]"""

    include: File
    """Always select the photos named in this file, one name per line"""

    exclude: File
    """Never select the photos named in this file, one name per line"""

    sharpness: bool
    """Prefer sharper photos among nearly equal choices"""

    suggest: int
    """Number of additional poses to suggest"""

    outside_paths: bool
    """Read files that a transforms.json names outside its own folder too"""

    copy: bool
    """Copy images and masks instead of making symbolic links"""

    seed: int
    """Seed of every random number"""

    points: int
    """Points of the surface that coverage-based methods choose by, and as many others for geometric metrics"""

    device: Union[str, int]
    """Device, by index or part of its name (see `camsplat devices`) [default: the best]"""

    debug_sync: bool
    """Wait after every stage, so that a device-lost error names the stage that failed; no effect while stages are timed"""

    train_every: int
    """Training iterations before each choice, for each photo chosen so far; 100, as published, are 495,000 iterations in total for 100 photos [default: 100]"""

    max_splats: int
    """Maximum number of splats [default: 200000]"""

    shrink: int
    """Downsampling factor of the photos [default: 1]"""

    background: Literal["black", "white", "random"]
    """Background [default: black]"""


class TrainOptions(TypedDict, total=False):
    """Options of `camsplat train`."""

    preset: Literal["full", "fast"]
    """How many iterations a run has"""

    iterations: int
    """Iterations; the schedule is that of 30000, compressed for fewer [default: the preset's]"""

    max_splats: int
    """Maximum number of splats [default: 1000000, or as many as the device can address]"""

    strategy: Literal["mcmc", "adc"]
    """How the number of splats changes"""

    sh: int
    """Degree of the spherical harmonics, 0 to 3"""

    background: Literal["black", "white", "random"]
    """Background, also trained where masks or alpha leave the photo out [default: white where photos have masks or alpha that mean it, else black]"""

    antialiased: bool
    """Mip-Splatting's 2D filter: splats smaller than a pixel fade instead of growing; the file says so to renderers"""

    exposure: bool
    """Learn each photo's exposure and white balance: for phones, whose photos of one thing differ. Test views are compared with the exposure that fits the other half of the picture"""

    refine_poses: bool
    """Correct each photo's pose, by a degree or so: where a phone's tracking or a reconstruction is off. In the end the poses of test views are corrected as well"""

    masks: Literal["background", "ignore"]
    """What masks and alpha channels say of what they leave out"""

    suppress_floaters: bool
    """Penalise opacity and size more, above all at first: fewer floaters where a capture has no points and its photos show surroundings; other captures lose detail (mcmc only)"""

    fast: bool
    """Sum gradients by atomic additions in any order: faster, but no two runs are the same"""

    init_opacity: float
    """Opacity of splats at the start [default: 0.5; adc, and below 10000 iterations (1000 without points that a photo saw), 0.1, or 0.95 at points with normals]"""

    init_scale: float
    """Size of splats at the start, in distances to their neighbours [default: 0.1; adc, and below 10000 iterations (1000 without points that a photo saw), 1, or 0.9 at points with normals]"""

    test_every: int
    """Hold out every Nth photo, in order of name, for testing; 0 for none [default: transforms_test.json where there is one, else 8]"""

    test: File
    """Test with the photos of another capture in the same frame"""

    shrink: int
    """Downsampling factor of the photos: each pixel is the mean of a square of this many per side"""

    skip_missing: bool
    """Continue without images that are missing or cannot be read"""

    outside_paths: bool
    """Read files that a transforms.json names outside its own folder too"""

    seed: int
    """Seed of every random draw"""

    save_every: int
    """Iterations between checkpoints; 0 for one at the end"""

    evaluate_every: int
    """Iterations between evaluations of the test views; 0 for one at the end [default: a tenth of the iterations]"""

    resume: bool
    """Continue from the checkpoint in the folder"""

    force: bool
    """Replace files in a folder that is not empty"""

    format: Union[Literal["ply", "packed", "splat", "spz", "spz4", "sog", "glb"], Sequence[Literal["ply", "packed", "splat", "spz", "spz4", "sog", "glb"]]]
    """Write the model in these formats too, beside point_cloud.ply"""

    profile: bool
    """Print GPU time per stage"""

    trace: File
    """Write a trace of host and GPU time that Perfetto opens"""

    device: Union[str, int]
    """Device, by index or part of its name (see `camsplat devices`) [default: the best]"""

    debug_sync: bool
    """Wait after every stage, so that a device-lost error names the stage that failed; no effect while stages are timed"""


class EvaluateOptions(TypedDict, total=False):
    """Options of `camsplat evaluate`."""

    preset: Literal["object", "room"]
    """Kind of the scenes: objects seen from around them, or rooms seen from inside [default: room with --box, else object]"""

    pool: Union[File, Sequence[File]]
    """Select from captures of photos instead of planning; every eighth photo is held out"""

    box: Numbers
    """In a room, cameras and test views stand in a box: corners X0,Y0,Z0,X1,Y1,Z1 [default: the room's bounds less the clearance]"""

    clearance: float
    """In a room, no camera closer than this to the surface [default: a twentieth of the room's smallest side]"""

    env: File
    """Environment map that lights all scenes: an equirectangular .hdr file, +Y up"""

    methods: Union[str, Sequence[str]]
    """Methods to compare: any --method of `camsplat plan`, ours:KEY=VALUE or paper:KEY=VALUE (with a key of its configuration changed), each also as METHOD@DEGREES (with a lens of another field of view), or cameras:FILE, a layout of your own in any format that `camsplat capture` reads, with the lens of the others (lenses:FILE: with its own); in FILE, {scene}, {views} and {seed} stand for those of a run, and NAME=cameras:FILE is called NAME in tables [default: random, fibonacci, fvs, fvs-chord, fvs-shared, acp, fisherrf, fisherrf-retrain, cover, manifold, paper-iterative, paper-no-vds, paper, ours; rooms: without fibonacci and manifold; pools: random, fvs, coverage, acp, fisherrf, cover, ours; quick: random, fvs, ours]"""

    budgets: Union[int, Sequence[int]]
    """Numbers of views [default: 50,100; rooms 300; pools 20,40; quick: 20; rooms 30]"""

    seeds: int
    """Runs of each method, for confidence intervals"""

    first_seed: int
    """Seed of the first run: an evaluation can be split over several machines with the same device, and their scene folders copied into one"""

    quick: bool
    """Small images and short training: minutes on two cores"""

    surface: Literal["proxy", "true"]
    """Surface that methods plan on [default: proxy; quick rooms: true]"""

    space: Literal["open", "known"]
    """Space in which methods place cameras; test views are from all of the region [default: open]"""

    size: int
    """Side of the images in pixels [default: 800; quick: 96]"""

    light: Literal["baked", "traced"]
    """Diffuse light of the photographs: baked once for all of a scene, or traced for each pixel [default: rooms baked, objects traced]"""

    spp: int
    """Samples per pixel, at least where light is baked [default: baked 64, traced 256; quick: 8]"""

    input_spp: int
    """Samples per pixel of the input photos [default: as --spp; traced rooms at least 1024, since path-traced photos of few samples are noisier than a camera's; quick: as --spp]"""

    test_spp: int
    """Samples per pixel of the test views, whose noise limits every score [default: as --spp]"""

    inputs: int
    """Input photos: the surface, its scores and the model of methods that need one are made from them; they are not trained on [default: 10; rooms 30]"""

    inputs_from: Literal["uniform", "random", "biased"]
    """Where around an object the input photos are taken [default: uniform]"""

    tests: int
    """Test views of each set: three of objects, one of rooms [default: 200; quick: 12]"""

    viewers: Union[File, Cameras, Plan, npt.ArrayLike]
    """Where the trained model will be viewed from: shell:CX,CY,CZ,RMIN,RMAX; box:X0,Y0,Z0,X1,Y1,Z1; cone:DEGREES,X,Y,Z, the default within a cone around this direction; heights:LOW,HIGH, the default between these; or a file or folder of cameras [default: around an object, between half of the region's outer radius and all of it; in rooms, anywhere; with `select`, where the photos were taken]"""

    situation: Literal["free", "floor", "wall", "corner", "clutter", "one-side", "front", "two-rooms", "bare-room", "furnished-room", "crowded-room", "long-room", "library", "small-room"]
    """Surroundings in which objects are photographed, or built-in rooms. Floors, walls and blocks become part of the scene, and cameras and viewers respect them [default: free]"""

    keep_out: Union[File, Sequence[File]]
    """Keep cameras and viewers out of a volume, which itself blocks no view: a closed mesh (.obj, .glb, .gltf, .ply), boxes, .json with {"boxes": [[X0,Y0,Z0,X1,Y1,Z1], ...]}, or, at all heights, polygons of GeoJSON or KML (needs --geo); repeatable"""

    wall: Union[Numbers, Sequence[Numbers]]
    """Keep cameras and viewers on one side of a plane, given by a point and the direction to the free side; repeatable; `none` leaves out the walls that points and photos of a capture show"""

    heights: Numbers
    """Restrict cameras to heights that a tripod or drone reaches: coordinates along --up, not distances from the floor"""

    walk: Numbers
    """Restrict cameras to level ground that a person or robot of this radius and height can walk to from a start: coordinates of the feet on open floor, in the frame of the surface"""

    shrink: int
    """Downsampling factor of a pool's photos [default: 1; quick: 8]"""

    iterations: int
    """Training iterations [default: 30000; quick: 300]"""

    max_splats: int
    """Maximum number of splats [default: 1000000; quick: 5000]"""

    antialiased: bool
    """Train with Mip-Splatting's filter, which helps views from farther away than the photos"""

    lpips_vgg: File
    """Also measure LPIPS with VGG16, with these weights (safetensors, made by scripts/make_lpips_weights.py); finished trainings are reused"""

    paper: bool
    """The paper's protocol, with every method of its tables and baselines on the outer sphere; LPIPS is AlexNet's without --lpips-vgg"""

    baselines_from: Literal["region", "sphere"]
    """Where around an object baselines may place cameras; the planner always has the whole region [default: region; paper: sphere]"""

    devices: Union[Union[str, int], Sequence[Union[str, int]]]
    """Devices to spread the runs over, each by index or part of its name"""

    shard: str
    """Make part I of N of the runs, for one of N machines; tables are written by the same command without this option, in the folder that they share or into which theirs are copied"""

    device: Union[str, int]
    """Device, by index or part of its name (see `camsplat devices`) [default: the best]"""

    debug_sync: bool
    """Wait after every stage, so that a device-lost error names the stage that failed; no effect while stages are timed"""


class NextOptions(TypedDict, total=False):
    """Options of `camsplat next`."""

    connect: float
    """Place the photos so that structure from motion can join them to those that there are: each sees much of what one of these sees, at no wider an angle than this, in degrees"""

    preset: Literal["object", "room"]
    """Kind of scene: an object seen from around it, or a room seen from inside [default: room with --box, else object]"""

    shell: Numbers
    """Region of the cameras between two spheres: centre and radii CX,CY,CZ,RMIN,RMAX"""

    box: Numbers
    """Region of the cameras in a box: corners X0,Y0,Z0,X1,Y1,Z1"""

    floor: Union[float, str]
    """Cameras stay at or above this height along --up; `auto` finds what an object stands on below all photos of a capture, `none` is no floor"""

    up: str
    """Up direction: x, -x, +y, ... [default: the photos' own for captures, +y for glTF, as the ground of an OBJ shows it, else +z]"""

    clearance: float
    """Minimum distance between cameras and the surface [default: a twentieth of the object's radius or of the room's smallest side]"""

    keep_out: Union[File, Sequence[File]]
    """Keep cameras and viewers out of a volume, which itself blocks no view: a closed mesh (.obj, .glb, .gltf, .ply), boxes, .json with {"boxes": [[X0,Y0,Z0,X1,Y1,Z1], ...]}, or, at all heights, polygons of GeoJSON or KML (needs --geo); repeatable"""

    wall: Union[Numbers, Sequence[Numbers]]
    """Keep cameras and viewers on one side of a plane, given by a point and the direction to the free side; repeatable; `none` leaves out the walls that points and photos of a capture show"""

    heights: Numbers
    """Restrict cameras to heights that a tripod or drone reaches: coordinates along --up, not distances from the floor"""

    walk: Numbers
    """Restrict cameras to level ground that a person or robot of this radius and height can walk to from a start: coordinates of the feet on open floor, in the frame of the surface"""

    space: str
    """Where cameras and viewers can be: `known`, where the photos of a capture prove it, connected with where they were taken; `open`, wherever nothing is known to be; the inside of a closed mesh or of boxes (as for --keep-out), or the space of a plan.json [default: known for captures, else open; of `next` and `watch` open around an object, and known as far as photos see in a room]"""

    reach: float
    """How far from the nearest photo known space reaches, half of it up or down [default: two of a photographer's steps, as the spacing of the photos shows them]"""

    geo: str
    """Where the scene lies on Earth, for polygons of --keep-out: LAT,LON,ALT[,HEADING] of its origin, utm:ZONE[,EAST,NORTH[,ALT]], ecef, or a capture with GPS, as for `export`"""

    subject: str
    """What of the surface is to be seen, where it holds more: a box X0,Y0,Z0,X1,Y1,Z1, a closed mesh or boxes as for --keep-out, a mesh that is a part of the surface, or `largest`, the largest thing that stands on the ground; the rest blocks views, and its ground is the floor [default: all of the surface]"""

    margin: float
    """Metres that cameras and the tour keep from polygons of --keep-out: GPS drifts [default: 3]"""

    viewers: Union[File, Cameras, Plan, npt.ArrayLike]
    """Where the trained model will be viewed from: shell:CX,CY,CZ,RMIN,RMAX; box:X0,Y0,Z0,X1,Y1,Z1; cone:DEGREES,X,Y,Z, the default within a cone around this direction; heights:LOW,HIGH, the default between these; or a file or folder of cameras [default: around an object, between half of the region's outer radius and all of it; in rooms, anywhere; with `select`, where the photos were taken]"""

    device: Union[str, int]
    """Device, by index or part of its name (see `camsplat devices`) [default: the best]"""

    debug_sync: bool
    """Wait after every stage, so that a device-lost error names the stage that failed; no effect while stages are timed"""

    seed: int
    """Seed of every random number"""
