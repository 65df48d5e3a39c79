//! Motion vectors and positions of renderers become ours: what they lead to in a frame beside is what the pixel shows.

use std::path::{Path, PathBuf};

use linpred::channels::{Mapping, Preset, Role, RoleRequest};
use linpred::exr_file::attributes::RawHeader;
use linpred::job::{Input, InputRequest, inspect};
use linpred::{InputRow, Motion, RowSource};
use linpred_tests::command::{denoise_file, linpred};
use linpred_tests::images::{
    NamedSamples, TestPart, bits, colour, constant, float, half, part, plane, read, write,
};

const LIMIT: u64 = 1 << 30;
const SIZE: (usize, usize) = (23, 21);
const PIXELS: usize = SIZE.0 * SIZE.1;

/// A frame that Cycles rendered (see `data/README.md`); only number 3 says where its surfaces are.
fn cycles(frame: usize) -> PathBuf {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
    data.join(format!("cycles_motion.{frame:04}.exr"))
}

fn open(path: &Path) -> Input {
    Input::open(&InputRequest::new(path)).unwrap()
}

/// A file of one part with these channels.
fn file(folder: &tempfile::TempDir, channels: Vec<NamedSamples>) -> PathBuf {
    let path = folder.path().join("in.exr");
    write(&path, SIZE, vec![part(channels)]);
    path
}

/// Every row of a frame of a sequence.
fn rows(input: &Input) -> Vec<InputRow> {
    let mut source = input.source_in_sequence(LIMIT).unwrap();
    let layout = source.layout();
    assert_eq!(layout, input.layout_in_sequence());
    let read = |y| {
        let mut row = InputRow::new(&layout);
        source.read_row(y, &mut row).unwrap();
        assert!(row.fits(&layout));
        row
    };
    (0..layout.size.height()).map(read).collect()
}

/// The mean squared difference of the colours of `own` to those of `other` where `vector` (right, down) leads from a column and row, of the pixels that it leads to
/// within the picture.
fn difference(
    own: &[InputRow],
    other: &[InputRow],
    vector: impl Fn(usize, usize) -> [f32; 2],
) -> f32 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (y, row) in own.iter().enumerate() {
        for x in 0..row.colour[0].len() {
            let [right, down] = vector(x, y);
            let (column, line) = ((x as f32 + right).round(), (y as f32 + down).round());
            let inside = column >= 0.0 && column < row.colour[0].len() as f32 && line >= 0.0;
            let target = other.get(line as usize).filter(|_| inside);
            let Some(target) = target else {
                continue;
            };
            for (a, b) in row.colour.iter().zip(&target.colour) {
                sum += (a[x] - b[column as usize]).powi(2);
            }
            count += 3.0;
        }
    }
    assert!(count > 0.5 * 3.0 * (own.len() * own[0].colour[0].len()) as f32);
    sum / count
}

/// Asserts that the vectors lead to what the pixels show, and turned round, exchanged or left out do not.
#[track_caller]
fn assert_only_these_fit(
    own: &[InputRow],
    other: &[InputRow],
    vectors: impl Fn(&InputRow) -> &[Vec<f32>; 2],
) {
    let at = |x: usize, y: usize| {
        let [right, down] = vectors(&own[y]);
        [right[x], down[x]]
    };
    let fit = difference(own, other, at);
    for signs in [[1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0], [0.0, 0.0]] {
        let turned = |x, y| {
            let [right, down] = at(x, y);
            [signs[0] * right, signs[1] * down]
        };
        let wrong = difference(own, other, turned);
        assert!(fit < 0.5 * wrong, "{fit} against {wrong} with {signs:?}");
    }
    for signs in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]] {
        let exchanged = |x, y| {
            let [right, down] = at(x, y);
            [signs[0] * down, signs[1] * right]
        };
        let wrong = difference(own, other, exchanged);
        assert!(
            fit < 0.5 * wrong,
            "{fit} against {wrong}, exchanged with {signs:?}"
        );
    }
}

#[test]
fn vectors_of_cycles_lead_to_the_same_surface_in_the_frame_before() {
    let [before, own] = [2, 3].map(|frame| rows(&open(&cycles(frame))));
    assert_only_these_fit(&own, &before, |row| &row.backward);
}

#[test]
fn vectors_of_cycles_lead_to_the_same_surface_in_the_frame_after() {
    let [own, after] = [3, 4].map(|frame| rows(&open(&cycles(frame))));
    assert_only_these_fit(&own, &after, |row| &row.forward);
}

/// The ground of that scene is at a height of 0 and the top of the cube at 2.1, wherever the camera is and looks.
#[test]
fn positions_of_cycles_are_those_of_the_world() {
    let input = open(&cycles(3));
    let all = Motion {
        backward: true,
        forward: true,
        position: true,
    };
    assert_eq!(input.motion(), all);
    let heights = rows(&input).into_iter().flat_map(|row| {
        let [_, _, height] = row.position;
        height
    });
    let heights: Vec<f32> = heights.collect();
    let of = |wanted: f32| {
        heights
            .iter()
            .filter(|z| (**z - wanted).abs() < 1e-4)
            .count()
    };
    assert!(of(0.0) > heights.len() / 2, "{}", of(0.0));
    assert!(of(2.1) > 10, "{}", of(2.1));
    assert!(heights.iter().all(|z| (-1e-4..2.1001).contains(z)));
}

#[test]
fn our_own_names_are_read_as_they_stand() {
    let folder = tempfile::tempdir().unwrap();
    let mut channels = colour(PIXELS);
    for (name, value) in [
        ("motion.X", 1.5),
        ("motion.Y", -2.5),
        ("motionForward.X", 3.0),
        ("motionForward.Y", 4.0),
        ("P.X", 5.0),
        ("P.Y", 6.0),
        ("P.Z", 7.0),
    ] {
        channels.push(constant(name, PIXELS, value));
    }
    let row = rows(&open(&file(&folder, channels))).swap_remove(4);
    let first = |plane: &Vec<f32>| plane[0];
    assert_eq!(row.backward.each_ref().map(first), [1.5, -2.5]);
    assert_eq!(row.forward.each_ref().map(first), [3.0, 4.0]);
    assert_eq!(row.position.each_ref().map(first), [5.0, 6.0, 7.0]);
}

/// Opens a file with the channels `flow.X`, `flow.Y` and `speed.u`, and this mapping.
fn mapped(mapping: &str) -> Result<Input, linpred::Error> {
    let folder = tempfile::tempdir().unwrap();
    let mut channels = colour(PIXELS);
    for (name, value) in [("flow.X", 1.0), ("flow.Y", 2.0), ("speed.u", 3.0)] {
        channels.push(constant(name, PIXELS, value));
    }
    let roles = RoleRequest {
        map: vec![Mapping::parse(mapping).unwrap()],
        ..RoleRequest::default()
    };
    Input::open(&InputRequest::new(file(&folder, channels)).with_roles(roles))
}

#[test]
fn a_minus_turns_a_mapped_component_round() {
    for (mapping, wanted) in [
        ("motion=flow", [1.0, 2.0]),
        ("motion=flow.X,flow.Y", [1.0, 2.0]),
        ("motion=flow.X, -flow.Y", [1.0, -2.0]),
        ("motion=-speed.u,flow.X", [-3.0, 1.0]),
    ] {
        let row = rows(&mapped(mapping).unwrap()).swap_remove(0);
        assert_eq!(
            [row.backward[0][0], row.backward[1][0]],
            wanted,
            "{mapping}"
        );
    }
    let row = rows(&mapped("motion-forward=flow").unwrap()).swap_remove(0);
    assert_eq!([row.forward[0][0], row.forward[1][0]], [1.0, 2.0]);
    assert!(row.backward[0].is_empty());
}

#[test]
fn half_a_vector_cannot_be_mapped() {
    for mapping in [
        "motion=flow.X",
        "motion=speed",
        "motion=flow.X,flow.Y,speed.u",
        "motion-forward=flow.X,-nothing",
    ] {
        let error = mapped(mapping).unwrap_err().to_string();
        assert!(error.contains("two channels joined by a comma"), "{error}");
    }
}

#[test]
fn vectors_that_are_not_finite_or_not_there_are_not_known() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let mut vectors = vec![constant("Y", PIXELS, 2.0)];
    vectors.push(plane("X", SIZE, |x, y| match (x, y) {
        (4, 0) => f32::INFINITY,
        _ => 1.0,
    }));
    let named = |name, part| TestPart {
        name: Some(name),
        ..part
    };
    let parts = vec![
        named("rgba", part(colour(PIXELS))),
        named("motion", part(vectors)),
    ];
    write(&path, SIZE, parts);
    // the part of the vectors begins two columns to the right of the colour's
    let stored = std::fs::read(&path).unwrap();
    let mut header = RawHeader::parse(&stored).unwrap().unwrap();
    let window = header.parts[1].value("dataWindow", "box2i").unwrap();
    let mut window = window.to_vec();
    for at in [0, 8] {
        let x = i32::from_le_bytes(window[at..at + 4].try_into().unwrap()) + 2;
        window[at..at + 4].copy_from_slice(&x.to_le_bytes());
    }
    header.parts[1].set("dataWindow", "box2i", window);
    let mut patched = RawHeader::encode(header.version, &header.parts);
    patched.extend_from_slice(&stored[header.length..]);
    std::fs::write(&path, patched).unwrap();

    let input = open(&path);
    assert!(
        input.roles.warnings.is_empty(),
        "{:?}",
        input.roles.warnings
    );
    let row = rows(&input).swap_remove(0);
    for (plane, known) in row.backward.iter().zip([1.0, 2.0]) {
        for (x, value) in plane.iter().enumerate() {
            match x {
                0 | 1 | 6 => assert!(value.is_nan(), "{value} at {x}"),
                _ => assert_eq!(*value, known, "{x}"),
            }
        }
    }
}

/// Of the channels `names` beside a colour, those in a role.
fn playing(preset: Option<&str>, names: &[&str], role: Role) -> Option<String> {
    let folder = tempfile::tempdir().unwrap();
    let mut channels = colour(PIXELS);
    channels.extend(names.iter().map(|name| float(name, PIXELS, 1)));
    let roles = RoleRequest {
        preset: preset.map(|name| Preset::named(name).unwrap()),
        ..RoleRequest::default()
    };
    let request = InputRequest::new(file(&folder, channels)).with_roles(roles);
    let input = Input::open(&request).unwrap();
    let assignment = input.roles.assignment(role)?;
    let channels = assignment.channels.iter();
    let names: Vec<String> = channels.map(|at| input.names.name(*at)).collect();
    Some(names.join(" "))
}

#[test]
fn each_renderer_has_names_of_its_own_for_motion() {
    use Role::{Motion, MotionForward, Position};
    for (preset, names, role, wanted) in [
        (
            Some("renderman"),
            &["backward.x", "backward.y", "backward.z"][..],
            Motion,
            "backward.x backward.y",
        ),
        (
            Some("renderman"),
            &["forward.r", "forward.g", "forward.b"],
            MotionForward,
            "forward.r forward.g",
        ),
        (Some("pbrt"), &["Px", "Py", "Pz"], Position, "Px Py Pz"),
        (
            Some("mitsuba"),
            &["pp.X", "pp.Y", "pp.Z"],
            Position,
            "pp.X pp.Y pp.Z",
        ),
        (
            Some("arnold"),
            &["P.X", "P.Y", "P.Z"],
            Position,
            "P.X P.Y P.Z",
        ),
        (
            None,
            &["position.x", "position.y", "position.z"],
            Position,
            "position.x position.y position.z",
        ),
    ] {
        let found = playing(preset, names, role);
        assert_eq!(found.as_deref(), Some(wanted), "{preset:?}");
    }
}

/// RenderMan's `P` moves with the camera, and Arnold's `motionvector` counts in no unit that its manual tells.
#[test]
fn what_is_called_like_motion_but_is_none_plays_no_role() {
    let position = ["P.x", "P.y", "P.z"];
    assert_eq!(playing(Some("renderman"), &position, Role::Position), None);
    let vectors = ["motionvector.X", "motionvector.Y"];
    assert_eq!(playing(Some("arnold"), &vectors, Role::Motion), None);
    assert_eq!(playing(None, &["Vector.X", "Vector.Y"], Role::Motion), None);
}

/// The same picture twice, with what tells of motion and with channels of other names in its place.
#[test]
fn a_frame_alone_has_the_bits_it_had_without_motion() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["motion.X", "motion.Y", "P.X", "P.Y", "P.Z"];
    let others = ["other.X", "other.Y", "more.X", "more.Y", "more.Z"];
    let outputs = [names, others].map(|names| {
        let mut channels = colour(PIXELS);
        channels.extend(["spec.R", "spec.G", "spec.B"].map(|name| float(name, PIXELS, 4)));
        channels.extend(
            (5..)
                .zip(names)
                .map(|(seed, name)| half(name, PIXELS, seed)),
        );
        let input = file(&folder, channels);
        let output = folder.path().join("out.exr");
        denoise_file(&input, &output, &["--layers", "*"]).succeeds();
        let (input, output) = (read(&input), read(&output));
        for name in names {
            assert_eq!(bits(&input, 0, name), bits(&output, 0, name), "{name}");
        }
        let attributes = &output.layer_data[0].attributes.other;
        let made_of = format!("{attributes:?}");
        assert!(!made_of.contains(names[0]), "{made_of}");
        ["R", "G", "B", "spec.R"].map(|name| bits(&output, 0, name))
    });
    assert_eq!(outputs[0], outputs[1]);
}

#[test]
fn only_a_sequence_reads_the_channels_of_motion() {
    let input = open(&cycles(3));
    let names = |channels: Vec<_>| {
        let names = channels.into_iter().map(|at| input.names.name(at));
        names.collect::<Vec<String>>()
    };
    let alone = names(input.channels());
    let of_motion = |name: &String| name.contains("Vector") || name.contains("Position");
    assert!(!alone.iter().any(of_motion), "{alone:?}");
    assert_eq!(input.layout().motion, Motion::default());
    let mut added = names(input.channels_in_sequence());
    added.retain(|name| !alone.contains(name));
    assert_eq!(added.len(), 7, "{added:?}");
    assert!(added.iter().all(of_motion));
}

#[test]
fn layers_that_are_no_light_are_left_out_of_a_sequence() {
    let folder = tempfile::tempdir().unwrap();
    let mut channels = colour(PIXELS);
    channels.extend(["spec.R", "spec.G", "spec.B", "fog.V"].map(|name| float(name, PIXELS, 9)));
    let layers = ["spec", "fog"].map(str::to_owned).to_vec();
    let request = InputRequest::new(file(&folder, channels)).with_layers(layers);
    let input = Input::open(&request).unwrap();
    let layout = |input: &Input| (input.layout().layers, input.layout().scalars);
    assert_eq!(layout(&input), (1, 1));
    let row = rows(&input).swap_remove(0);
    assert_eq!((row.layers.len(), row.scalars.len()), (1, 0));
    assert_eq!(
        input.channels_in_sequence().len() + 1,
        input.channels().len()
    );
}

#[test]
fn inspect_says_how_neighbours_would_be_found() {
    let folder = tempfile::tempdir().unwrap();
    let vectors = ["motion.X", "motion.Y"].map(|name| float(name, PIXELS, 1));
    let forward = ["motionForward.X", "motionForward.Y"].map(|name| float(name, PIXELS, 1));
    let position = ["P.X", "P.Y", "P.Z"].map(|name| float(name, PIXELS, 1));
    for (channels, wanted) in [
        (vec![], "none in the file, taken for still"),
        (
            position.to_vec(),
            "world position (P.X, P.Y, P.Z), by search",
        ),
        (
            vectors.to_vec(),
            "vectors (motion.X, motion.Y), the frame before",
        ),
        (
            forward.to_vec(),
            "vectors (motionForward.X, motionForward.Y), the frame after",
        ),
        (
            [&vectors[..], &forward, &position].concat(),
            "vectors (motion.X, motion.Y, motionForward.X, motionForward.Y), the frame before and after",
        ),
    ] {
        let path = file(&folder, [colour(PIXELS), channels].concat());
        let (inspection, problem) = inspect(&InputRequest::new(&path)).unwrap();
        assert!(problem.is_none());
        assert_eq!(inspection.motion.as_deref(), Some(wanted));
        let path = path.to_str().unwrap();
        let said = linpred(["inspect", path]).succeeds().stdout();
        assert!(
            said.contains(&format!("\n  motion            {wanted}\n")),
            "{said}"
        );
        let said = linpred(["inspect", path, "--json"]).succeeds().stdout();
        let said: serde_json::Value = serde_json::from_str(&said).unwrap();
        assert_eq!(said["motion"], wanted);
    }
}
