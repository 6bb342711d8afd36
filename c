# Monro

Monro turns a head CT into a patient model and simulates, or guides live, the insertion of an external ventricular drain (EVD):
a tube from Kocher's point on the skull to the foramen of Monro inside the brain, which lets fluid out of the brain's ventricles.
The brain yields as the catheter goes in, and what Monro shows is the *deformed* anatomy, not the preoperative one.

- *Nasion*: the dip at the root of the nose.
- *Kocher's point*: the usual entry, 11 cm up the midline from the nasion and 3 cm to the side.
- *Foramen of Monro*: the opening from a lateral ventricle into the third.

Monro does openly, in Rust, what the paper it starts from describes ("Simulation Method for the Physical Deformation of a Three-Dimensional
Soft Body in Augmented Reality-Based External Ventricular Drainage"), and measures what it claims.

**Research software. Not for clinical use.**

![A simulated insertion into the built-in phantom: the head with catheter and ventricles, and slices before and after](docs/insertion.png)

*The built-in phantom at the end of `make demo`: a made-up head, segmented, meshed and simulated by the program itself.*

## Two commands

    make demo      # builds, prepares the built-in phantom, simulates an insertion, writes a report, shows it live until Ctrl-C
    make test      # everything that CI runs; installs what it needs and says so

You need Linux and [Rust](https://rustup.rs). `make` installs a C and a C++ compiler with apt where they are missing; elsewhere
install them yourself. `make test` also needs Python 3 and Node.js 20 or newer. The first time `make demo` compiles for 4 to 5 minutes on two cores;
the demo itself takes 13 to 30 s, by the machine. It writes to `out/demo` (`monro demo` without `--out` to `monro-demo`), with a `report.html` in the folders
`case` and `insertion`; `make demo HEADLESS=1` ends with the report.

The web app of `monro serve` and `monro edit` is in the program when `scripts/web.sh build` (Node.js 20 or newer) ran before `cargo build`. `make demo` does that where it finds
Node.js; `make demo HEADLESS=1` and `cargo build` alone do not, and then a page says so. To have it afterwards: `scripts/web.sh build && cargo build --release`.

The program itself is `target/release/monro`, also after `cargo build --release`; below it is called `monro`:

    export PATH="$PWD/target/release:$PATH"

## What your scan must show

- A head CT in Hounsfield units, **without contrast agent** (one that the DICOM header names is told). Values that cannot be such, and heads in which fluid does not stand out from the brain, are refused.
  So is a spacing that makes a head impossibly large; one that makes it unusually large, small, high or low is told.
- The head **from the tip of the nose to above the vertex** (its highest point), **with the skin**: Kocher's point is measured from the nasion, over the skin, so a scan from the nasion up is the least.
  Before you use a path, **look at it in `report.html`**: a face that was blurred or filled in is not recognised. `--plan` gives a path of your own.

  | what is wrong with the scan | what happens | Kocher's point off by |
  |---|---|---|
  | face blurred, or filled in with something like skin | **not recognised** | 8 mm in one trial |
  | nose cut off | told | up to 30 mm |
  | nose hardly in the scan, voxels of 3 mm and more | told | up to 30 mm |
  | face cut off for anonymity, bone left bare | told | up to 29 mm in trials |
  | no nose stands out below the nasion | told | up to 30 mm |
  | cut head that was turned and filled up afterwards (registered, resampled) | told | 24 mm in one trial |
  | vertex cut off; whole slices of air filled in beyond a cut | told | not measured |
  | a side cut off | told; refused where the cut comes near a lateral ventricle | not measured |
  | skull cut out of its scan, skin and all gone | refused unless `--plan` gives the path | - |

- Slices of **up to 2 mm, if you can**. On real heads at 0.9 and 2 mm the overlap of the lateral ventricles with the references is 0.89 and 0.90 (Dice: 1 is the same, 0 nothing in common); the 2 mm head
  resampled to slices 5 mm apart has 0.88 and 0.89 on these slices, and 0.79 and 0.81 on a grid of 1 mm ([more](docs/segmentation.md#thick-slices)).
- Gantry tilt, uneven spacing, any order of the axes and of the files, and a head nodded by 20, turned by 45 or rolled by 30 degrees are no problem. A head that the header turns upside down, back to front or by a quarter about any axis is refused, with how it seems to lie.

## From your own scan to a catheter

    monro inspect  SCAN                            # what is it, and which series would be taken
    monro prepare  SCAN --out CASE                 # labels, surfaces, tetrahedra, plan; look at CASE/report.html
    monro simulate CASE --out RESULTS              # the insertion; look at RESULTS/report.html
    monro serve    CASE                            # the same live: prints an address for the browser

`SCAN` is a DICOM folder (any order, other series mixed in, gantry tilt, uneven spacing), or a NIfTI, NRRD or MetaImage file.

- `monro prepare --side left|right` chooses the side, `--elements N` the size of the mesh.
- Where the automatic segmentation or plan is not to your liking, draw labels or a line in 3D Slicer and give them:
  `monro prepare SCAN --out CASE --labels FILE --plan FILE.mrk.json`; or correct the labels in the browser (below). Labels come as NIfTI,
  NRRD, MetaImage, `.seg.nrrd` or DICOM-SEG; named segments are recognised by their SNOMED terms or names.
- On any command but `fake-tracker`, `--json` prints JSON on stdout instead of text. `--force`, where a command has it, overwrites an earlier output
  of the same command. A folder that holds anything else than what that command writes there is refused, with the names; a single file (`--out FILE`) is overwritten whatever it is. The command's input never is.

More to try:

    monro simulate CASE --out SHIFT --drain-ml 10 --gravity 0,9.81,0    # brain shift: lying on the back, 10 ml drained
    monro simulate CASE --out OUT --withdraw --tip cone:20              # in and out again, with a conical tip
    monro mesh CASE --elements 37336 --out tets.vtu                     # its tetrahedra at another size
    monro mesh CASE/labels.nii.gz --keep 4,5,6,7 --fine 5,6,7 --elements 37336 --out tets2.vtu  # of labels; without --keep scalp, skull and fluid take the elements
    monro solve examples/block/scene.json --mesh block --case weight --refine 0 --out weight.vtu  # a static question; --refine 0: quick, too stiff (6.0 mm; 6.9 without it)
    monro track sim: --frames 100                                       # poses of the scripted tracker; natnet://HOST, igtl://HOST
    monro serve CASE --tracker natnet://HOST                            # the live session with a real tracker instead of a script
    monro replay CASE-sessions/DATE.mnrs                                # the recorded session again

[docs/usage.md](docs/usage.md) has examples to copy for what these lines leave open, with file formats and what is printed: labels, trackers, calibration, registration, replay, benches.

| command | does |
|---|---|
| `monro demo` | all of it on the built-in phantom |
| `monro phantom` | writes a made-up head (or the paper's drawer phantom) as DICOM, with true labels and landmarks |
| `monro inspect` | lists the series of a folder and reads the one that would be taken: what is odd about it, and whether `prepare` would refuse it before the segmentation |
| `monro prepare` | CT to case |
| `monro edit` | labels of a scan or a case corrected in the browser, and the case built again from them |
| `monro labels convert` | labels between NIfTI, 3D Slicer (`.seg.nrrd`) and DICOM-SEG (`.dcm`), with names, colours and terms; `--images FOLDER`: on the planes of these DICOM images, with references to them, for an archive |
| `monro simulate` | case to insertion, with drainage, brain shift, other catheters and withdrawal ([options](docs/usage.md#insertions)). Look first at `reliable`, which must be true, then at `remarks` (this run) and `case_remarks` (the scan) |
| `monro solve` | a static scene ([JSON and meshes in SI](docs/scenes.md): supports, weight, pressure, spheres, rods) to displacement and reactions |
| `monro serve` | a live insertion in the browser and in 3D Slicer, recorded (`--mode`, `--materials`, `--iterations`, `--predicted-space` as in `simulate`): 3D, slices of the CT deformed with the tissue, guidance numbers, calibration by pivoting, registration by touch, glasses (WebXR), from a scripted or a real tracker; with `--scans DIR --out CASE` it begins with a scan, prepared in the browser |
| `monro replay` | plays a recorded session again and compares every snapshot bit for bit |
| `monro mesh` | graded, labelled tetrahedra from any label volume or from a case, as `.vtu`, `.msh`, `.ply`, `.stl`, `.obj`, `.glb`; density by label in steps of about eight (`--density`), grading (`--growth`, `--coarsest`), topology, volumes and shapes enforced (`--strict`), a page of cuts and tables (`--report`); checks and converts meshes ([what is refused](docs/mesh.md#meshes-from-elsewhere)) |
| `monro track`, `monro doctor` | live poses from NatNet (`natnet://HOST`), OpenIGTLink (`igtl://HOST`), a recording (`replay:FILE`) or a script (`sim:`); and why there are none |
| `monro calibrate`, `monro register` | tip, shaft, camera, see-through display; the patient by landmarks and skin, with the error that is to be expected |
| `monro fake-tracker` | acts as Motive or as PLUS and plays a scene with noise, dropouts and a bumped reference |
| `monro bench` | speed, memory, registration error and latency on your machine |

## Correcting the labels

    monro edit CASE                       # or: monro edit SCAN --out CASE, before there is a case

Open the address that it prints. Choose a label on the right (keys 1 to 7), scroll to a slice (wheel) and draw: with the
**livewire** (W), click along the edge; the wire follows the edge under the mouse, a click on the first point or Enter
closes it, Backspace takes a click back. "Inside is the label here" replaces the label on that slice, the other two modes
add and take away. Draw some slices, then F fills those between and ticks
"Between slices": from then on a correction by wire or brush goes on to the slices up to the next drawn ones.
Brush (B) and eraser (E) work in the slice or as a ball; threshold, growing from a seed with a guard against leaks,
islands, holes, smoothing that keeps the volume, margins and set operations show a preview first. "May change" protects
other labels and values. Ctrl+Z and Ctrl+Y undo and redo, `?` lists all keys. **Rebuild case** makes surfaces, plan and
tetrahedra again from the corrected labels (a path that was given stays). Every step is on disk before it is answered, in `CASE.edit` beside the case:
after a crash, start the same command again (`monro edit CASE` once the case was built).

## A live session

`monro serve CASE` prints an address. Open it in a browser: it shows the head in 3D and in slices of the CT that deform with the tissue, and the numbers to guide by, while a
scripted catheter goes in. With `--tracker URL` poses come from a real tracker instead, and the page leads through calibration, registration and the check first
([examples](docs/usage.md#a-tracker)). Every session is recorded beside the case (`--record FILE`, `--no-record`); `monro replay` plays it again.

- It listens on this machine unless `--listen 0.0.0.0:8443` says otherwise. Then it is encrypted (`--cert`, `--key`, or a certificate made at start), and prints a QR code and
  a one-time pairing code with which a tablet or glasses come in to look; the page makes further codes, for viewers and operators ("Let a device in", or `POST /api/pairing`).
- Preparing (`--scans`) and `monro edit` are for this machine only.
- Programs send `Authorization: Bearer TOKEN` with the token that `--json` prints; `/api/openapi.json` of `monro serve` lists what there is.
- 3D Slicer connects as OpenIGTLink client to port 18945.

## Files

A **case** is a folder of plain files: `case.toml` (manifest with SHA-256 hashes), `ct.nii.gz`, `labels.nii.gz`,
`skin.ply`, `brain.ply`, `ventricles.ply`, `tets.vtu`, `plan.mrk.json`, `landmarks.mrk.json`, and `report.html` to look at. ParaView and 3D Slicer open
them. The CT and labels may be left out to share a model without images. Labels: 0 outside, 1 scalp, 2 skull, 3 CSF
outside the ventricles, 4 brain, 5 left lateral, 6 right lateral, 7 third ventricle. No patient's name enters a case.

A **simulation** writes `insertion.csv` (time, tip, depth, distance to the target rigid and deformed, angle off the plan, displacement,
volume, force, step time), `insertion.pvd` with deformed tetrahedra over time, deformed surfaces, `summary.json`, and
`report.html`. The angle to the skull, in a case's `case.toml` and report, is that between path and skull surface: 90 degrees is perpendicular.

## Measured

"Goal" is what the project asks of itself. A goal that is missed has a bold **no**, with by how much. *nu* is Poisson's ratio. `make bench SCANS="..."` prints the times for your own scans.

| what | measured | goal | met |
|---|---|---|---|
| lateral ventricles against references, Dice (1 is the same, 0 nothing in common): 2 mm head; 0.9 mm head; averaged template | 0.90; 0.89; 0.87 | 0.88; 0.80; 0.85 | yes |
| points against those set by hand, three scans: foramina of Monro; Kocher's points | 2.2 to 3.7; 1.8 to 7.4 mm off | 6; 12 mm | yes |
| registration, simulated, 6 landmarks and 100 surface points: error at the foramen, median; 95 % | 0.20; 0.39 mm | 2; 3 mm | yes |
| angles between the faces of tetrahedra, 5,824 to 500,000 of them, two heads and ten phantoms | 25.2 to 153.0 degrees | 22 to 155 degrees | yes |
| mean edge near ventricles and path (within 2 mm), 37,336 tetrahedra: three heads; ten phantoms | 2.5, 2.7, **3.8**; **3.1 to 3.5** mm | 3.0 mm | **no**: 0.8 mm too long in one head, 0.1 to 0.5 mm on phantoms |
| beam bent far, nu 0.49: error (nodal-averaged finite elements: 5.7 %) | 5.0 % | not above these | yes |
| hollow sphere drained by 3 mm, nu 0.49: error on the mesh as given (nodal-averaged finite elements: 7.4 %) | **7.4 %** | 6.4 % | **no**: by 1.0 percentage point; 2.8 % on a mesh cut finer, the default |
| predicted space, its largest error | 0.02 to 1.1 %, by chance **17 %** | 2 % | **no**: 17 % in three of 18 orders of the vertices |
| live session, camera at 240 Hz, three displays: added latency, 99 % (an AMD EPYC, Zen 4) | 3.7 ms | 5 ms | yes |

- *Averaged template*: a published CT averaged from several heads, with published labels.
- *Predicted space*: the part of the tissue that is foreseen to move, where most of the work is then done (`--predicted-space`). Its *largest error* is the largest distance from the solution without it, over the displacement that the tool imposes.

Times on two machines, on two cores of each, which others share: an **AMD EPYC** (Zen 5, AVX-512; 2026-11-28) and an **Intel Xeon** (2.6 GHz; 2026-11-27; of `prepare`, `demo` and insertions 2026-11-23).
They were taken in quiet hours; frames of rod and probe are the slowest of three runs or more. Pairs are for 37,000 / 65,000 tetrahedra.

| what | EPYC | Xeon | goal | met |
|---|---|---|---|---|
| `prepare` of 512 x 512 x 91 voxels, with report | - | 12.3 s, 948 MiB | 20 s, 1.5 GiB | yes |
| `demo`, headless, after the build | - | 13 s | 30 s | yes |
| labels to 65,691 tetrahedra, one core: median of ten phantoms; two heads | 0.41; 0.43 to 0.50 s | 0.39; 0.45 to **0.51** s | 0.5 s | **no**: a head 0.51 s on one evening, and 5 to 7 % more since, for the path |
| a frame of the soft body, physical mode: a 3 mm rod pushed in (a probe pressed on from outside takes less) | 1.14 / 2.31 ms | 1.67 / 2.72 ms | 2 / 4 ms | yes |
| the same with the predicted space: rod | 0.98 / 1.71 ms | **1.59 / 2.54** ms | 1 / 2 ms | **no** on the Xeon: by 59 / 27 % |
| the same: probe | 0.98 / 1.58 ms | **1.39 / 2.41** ms | 1 / 2 ms | **no** on the Xeon: by 39 / 21 % |
| a frame of an insertion into one of three heads, 37,000, surfaces included: median | **1.9 to 2.4** ms | **2.4 to 3.2** ms | 2 ms | **no**: by up to 20 % on the EPYC, 20 to 60 % on the Xeon |
| Jolt 5.6 (a physics engine for games) on the probe, at 6,000 / 37,000 / 65,000: times as long as ours | 6.2 / 7.4 / 7.8 | 5.0 / 5.9 / 6.2 | 5 | **no** without AVX-512 (eight lanes, an EPYC Zen 3): **4.3** / 5.0 / 5.1 |

*Times as long as ours*: Jolt's time for a frame over Monro's, both with the same constraints (edges and volumes), iterations and mesh; more is better for Monro. Versions of Monro differ in some rows: the Xeon's of the predicted space are older than the EPYC's.

**[docs/measured.md](docs/measured.md) has all rows**, the other goals that are missed among them (livewire, surfaces, binding, other engines, memory, tracking), [docs/speed.md](docs/speed.md) and [docs/mesh.md](docs/mesh.md) how they were taken.

The hand-set points have uncertainties of 3 to 10 mm themselves; the Dice references of the first two scans are
semi-automatic. The averaged course of the ventricles that the segmentation starts from was taken from the three scans
with references, so only the tilted scan and the phantom are independent of it.

## Limits

The main ones; [docs/limits.md](docs/limits.md) has all, with numbers.

- **Research software, and young.** Nobody has compared it with a real insertion. Thresholds of puncture and friction are choices of the right order.
- **Segmentation**: CT only. Streaks of metal among the ventricles are not recognised, ventricles squeezed to slits are found too large, one that is filled altogether has to be drawn. Falx and tentorium are not found, so simulated heads have none. A scan cut open gives a partial model, and says so.
- **Confidence is not certainty**: that of a ventricle was set on three references; what calibrations and registrations say of their error does not know of a guide that gives way, hair on one half of the head, or a tip that rolls. The check at a landmark is what finds these.
- **Soft body**: the brain is held at the skull but around the burr hole, so the cortex does not sink. Walls of a ventricle that meet are not modelled: draining ends early, and says so. Ten iterations a frame leave some smooth motion out (1 to 8 %); for a static answer use `monro solve`. Forces of a catheter depend on the mesh by some 15 %, and a few elements beside the shaft may be crushed (told).
- **`monro solve`** tells what it does not converge on; surfaces that come to touch each other pass through each other, which is told.
- **Tetrahedra**: bounds on shape and volume hold on all heads and phantoms tried; the mean edge near large ventricles is 3.1 to 3.8 mm for 3.0, tips of thin horns are up to 1.8 mm off, and a brain's topology differs from the voxels' at thin bridges (told).
- **Live session**: glasses were tried in an emulator only, no real camera system was at hand, and 60 frames a second on a graphics card were never measured. What neither poses nor their server show is not told: a delay that was there from the beginning, a reference that slips by less than 1 mm.

## More

[docs/usage.md](docs/usage.md) has examples to copy, [docs/scenes.md](docs/scenes.md) the scenes of `monro solve`, [docs/measured.md](docs/measured.md) everything measured, [docs/limits.md](docs/limits.md) all that is missing. [docs/segmentation.md](docs/segmentation.md) holds the segmentation against truth and references, [docs/mesh.md](docs/mesh.md) the mesher's numbers, [docs/materials.md](docs/materials.md) every material constant with unit and source. [docs/solvers.md](docs/solvers.md) holds the solvers against converged solutions, error against time included.
[ARCHITECTURE.md](ARCHITECTURE.md) says how it is built and why, [CHANGELOG.md](CHANGELOG.md) what changed.
Licensed under MIT or Apache-2.0, at your option.
