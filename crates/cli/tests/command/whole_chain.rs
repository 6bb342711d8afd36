//! The phantom, written as DICOM, goes through the whole chain and comes out where its truth says.

use crate::common::{distance, json, monro, point, refusal, text};
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Positions of a Slicer markups file, by label, LPS mm.
fn markups(path: &Path) -> Vec<(String, [f64; 3])> {
    let value: Value = serde_json::from_slice(&fs::read(path).expect("markups")).expect("JSON");
    let points = value["markups"][0]["controlPoints"].as_array().expect("points").clone();
    points.iter().map(|p| (p["label"].as_str().expect("label").to_owned(), point(&p["position"]))).collect()
}

#[test]
fn a_phantom_written_as_dicom_becomes_a_case_and_the_catheter_reaches_csf() {
    let dir = tempfile::tempdir().expect("temp");
    let [phantom, case, out] = ["phantom 1", "case", "out"].map(|n| dir.path().join(n));
    json(&["phantom", "--out", text(&phantom), "--seed", "1"]);
    let inspected = json(&["inspect", text(&phantom.join("dicom"))]);
    assert_eq!(inspected["series"].as_array().expect("series").len(), 1, "{inspected}");

    let prepared = json(&["prepare", text(&phantom), "--out", text(&case), "--side", "left", "--elements", "20677"]);
    let elements = prepared["elements"].as_f64().expect("elements");
    assert!((elements / 20677.0 - 1.0).abs() <= 0.05, "{elements} elements");
    assert_eq!(prepared["plan"]["side"], "left");
    for (label, truth) in markups(&phantom.join("landmarks.mrk.json")) {
        let found = point(&prepared["landmarks_lps_mm"][&label]);
        let limit = if label.contains("Kocher") || label.contains("midline") { 12.0 } else { 6.0 };
        assert!(distance(found, truth) <= limit, "{label}: {found:?}, truth {truth:?}");
    }

    confidence_is_kept(&case);
    plans_of_another_head(&phantom, &case, dir.path());
    let done = json(&["simulate", text(&case), "--out", text(&out), "--speed", "40"]);
    assert_eq!((&done["reached_ventricle"], &done["ends_in_ventricle"]), (&true.into(), &true.into()), "{done}");
    assert!(done["frames"].as_u64().expect("frames") > 60);
    assert!(done["max_whole_volume_change_percent"].as_f64().expect("volume") < 1.0, "{done}");
    let csv = fs::read_to_string(out.join("insertion.csv")).expect("series");
    assert_eq!(csv.lines().count() as u64, done["frames"].as_u64().expect("frames") + 1);
    let html = fs::read_to_string(out.join("report.html")).expect("report");
    assert!(!html.contains("http://") && !html.contains("https://"), "the report must not need a network");
    assert_eq!((&done["reliable"], &done["inverted_most"]), (&Value::from(true), &Value::from(0)), "{done}");
    assert_eq!(done["self_crossing"], Value::Null, "{done}");
    forces_have_a_unit_in_physical_mode_only(&case, &done, dir.path());
    fifty_millimetres_of_mercury_gave_garbage_and_no_word(&case, dir.path());
    garbage_was_told_in_the_report_only(&case, dir.path());
    what_was_asked_was_in_no_result(&case, dir.path());
    walls_were_passed_and_nothing_was_drained_without_a_word(&case, dir.path());
    a_catheter_comes_out_from_beside_another(&case, &done, dir.path());
    falx_and_tentorium_part_a_brain_that_slides(&case, dir.path());
    registrations_by_wrong_tables_and_marks(&case, dir.path());
    a_file_of_the_case_was_emptied_for_the_numbers_of_a_replay(&case, dir.path());
    damaged_case(&case, dir.path());
}

/// The recording knows the case, which was not among the files that the command was given.
fn a_file_of_the_case_was_emptied_for_the_numbers_of_a_replay(case: &Path, dir: &Path) {
    let [recording, numbers, labels] = [dir.join("a.mnrs"), dir.join("numbers.jsonl"), case.join("labels.nii.gz")];
    let mut serve = Command::new(env!("CARGO_BIN_EXE_monro"))
        .args(["serve", text(case), "--listen", "127.0.0.1:0", "--no-igtl", "--record", text(&recording)])
        .stdout(Stdio::piped())
        .spawn()
        .expect("monro");
    let mut first = String::new();
    BufReader::new(serve.stdout.take().expect("piped")).read_line(&mut first).expect("a line");
    assert!(first.contains("Open http"), "{first}");
    std::thread::sleep(Duration::from_secs(1));
    assert!(Command::new("kill").args(["-TERM", &serve.id().to_string()]).status().expect("kill").success());
    assert_eq!(serve.wait().expect("ended").code(), Some(0), "it is ended so");
    let played = json(&["replay", text(&recording), "--out", text(&numbers)]);
    assert!(played["frames"].as_u64().expect("frames") > 10 && numbers.is_file(), "{played}");
    let before = fs::read(&labels).expect("labels");
    let said = refusal(&["replay", text(&recording), "--out", text(&labels), "--force"]);
    assert!(said.contains("which this command reads"), "{said}");
    assert!(fs::read(&labels).expect("labels") == before);
}

/// A head on its side; a case without them is told.
fn falx_and_tentorium_part_a_brain_that_slides(case: &Path, dir: &Path) {
    let run = |case: &Path, more: &[&str]| {
        let out = dir.join("slid");
        let asked = ["--skull", "slides", "--gravity", "9.81,0,0", "--drain-ml", "2", "--speed", "80", "--force"];
        json(&[&["simulate", text(case), "--out", text(&out)][..], &asked, more].concat())
    };
    let [parted, alone] = [run(case, &[]), run(case, &["--no-septa"])];
    assert_eq!((&parted["septa"], &alone["septa"]), (&true.into(), &false.into()), "{parted}");
    let sunk = |done: &Value| done["cortex_shift_mm"].as_f64().expect("mm");
    assert!(sunk(&parted) > 0.5 && sunk(&parted) < 0.95 * sunk(&alone), "{} {}", sunk(&parted), sunk(&alone));
    let said = |done: &Value| done["remarks"].to_string().contains("no falx and tentorium");
    fs::rename(case.join("septa.ply"), dir.join("septa.ply")).expect("move");
    let without = run(case, &[]);
    assert!(said(&without) && !said(&parted) && !said(&alone) && without["septa"] == false, "{without}");
    fs::rename(dir.join("septa.ply"), case.join("septa.ply")).expect("move");
    a_catheter_through_the_falx_was_like_any_other(&markups(&case.join("landmarks.mrk.json")), &|more| run(case, more));
    let refused = refusal(&["simulate", text(case), "--out", text(&dir.join("held")), "--no-septa"]);
    assert!(refused.contains("--skull slides"), "{refused}");
}

/// From the right side to before the upper part of the path on the left.
fn a_catheter_through_the_falx_was_like_any_other(marks: &[(String, [f64; 3])], run: &dyn Fn(&[&str]) -> Value) {
    let [right, left, foramen] = ["Kocher right", "Kocher left", "Monro left"]
        .map(|name| marks.iter().find(|m| m.0 == name).expect("a landmark").1);
    let end: [f64; 3] =
        std::array::from_fn(|a| left[a] + 0.4 * (foramen[a] - left[a]) - if a == 1 { 18.0 } else { 0.0 });
    let place = |p: [f64; 3]| p.map(|v| v.to_string()).join(",");
    let path = format!("{}:{}", place(right), place(end));
    let done = run(&["--beside", &path]);
    let told = "Catheter 1 beside goes through falx or tentorium";
    assert!(done["remarks"].to_string().contains(told), "{}", done["remarks"]);
}

fn forces_have_a_unit_in_physical_mode_only(case: &Path, physical: &Value, dir: &Path) {
    assert!(physical["max_axial_force_mn"].as_f64() > Some(1.0), "{physical}");
    let out = dir.join("paper");
    let paper = json(&["simulate", text(case), "--out", text(&out), "--speed", "80", "--mode", "paper"]);
    assert!(paper["max_axial_force_mn"].is_null() && paper["max_axial_force_no_unit"].is_f64(), "{paper}");
    let csv = fs::read_to_string(out.join("insertion.csv")).expect("series");
    assert!(
        csv.lines().next().is_some_and(|l| l.contains(",axial_force_no_unit,") && !l.contains("_mn")),
        "{csv:.300}"
    );
    let html = fs::read_to_string(out.join("report.html")).expect("report");
    assert!(html.contains("no unit (paper mode)") && !html.contains(">mN<"), "the report names a unit");
    // Nothing bears weight there: a target shifted by 16 mm was called reliable.
    let refused =
        monro(&["simulate", text(case), "--out", text(&out), "--mode", "paper", "--gravity=0,9.81,0", "--force"]);
    assert!(String::from_utf8_lossy(&refused.stderr).contains("--gravity needs --mode physical"));
}

/// No number that is none, and what the brain's own tissue lost is told.
fn fifty_millimetres_of_mercury_gave_garbage_and_no_word(case: &Path, dir: &Path) {
    // In place of an earlier simulation, which is what --force is for.
    let out = dir.join("paper");
    let asked = ["--speed", "80", "--csf-pressure-mmhg", "50", "--force"];
    let done = json(&[&["simulate", text(case), "--out", text(&out)][..], &asked].concat());
    assert_eq!((&done["reliable"], &done["inverted_most"]), (&Value::from(true), &Value::from(0)), "{done}");
    assert!(done["max_target_shift_mm"].as_f64() < Some(15.0), "{done}");
    let [brain, ventricle] =
        ["brain", "left_lateral_ventricle"].map(|s| done["volumes"][s]["change_ml"].as_f64().expect("ml"));
    assert!(brain < -5.0 && ventricle > 5.0, "{done}");
    assert!(done["remarks"].to_string().contains("own tissue"), "{done}");
    let csv = fs::read_to_string(out.join("insertion.csv")).expect("series");
    assert!(!csv.contains("NaN") && csv.contains(",held,brain_change_ml,"), "{csv:.400}");
    let first = csv.lines().nth(1).expect("a frame");
    assert!(first.starts_with("-1.48"), "the pressure comes on before the insertion: {first}");
}

fn garbage_was_told_in_the_report_only(case: &Path, dir: &Path) {
    let out = dir.join("emptied");
    let holds: f64 = ["left_lateral", "right_lateral", "third", "fourth"]
        .iter()
        .filter_map(|v| {
            let file = fs::read_to_string(dir.join("out/summary.json")).expect("summary");
            let summary: Value = serde_json::from_str(&file).expect("JSON");
            summary["volumes"][format!("{v}_ventricle")]["rest_ml"].as_f64()
        })
        .sum();
    let drained =
        |ml: f64| monro(&["simulate", text(case), "--out", text(&out), "--speed", "80", "--drain-ml", &ml.to_string()]);
    // What can be drained is drained when the catheter begins to move; 73 % of it were.
    drained(0.3 * holds);
    let csv = fs::read_to_string(out.join("insertion.csv")).expect("series");
    let names: Vec<&str> = csv.lines().next().expect("a head").split(',').collect();
    let ventricles: Vec<usize> = (0..names.len()).filter(|&i| names[i].ends_with("ventricle_change_ml")).collect();
    let begins = csv.lines().skip(1).find(|row| !row.starts_with('-')).expect("a frame");
    let row: Vec<&str> = begins.split(',').collect();
    let gone: f64 = ventricles.iter().map(|&i| -row[i].parse::<f64>().expect("ml")).sum();
    assert!((gone / (0.3 * holds) - 1.0).abs() < 0.02, "{gone} of {} ml", 0.3 * holds);
    fs::remove_dir_all(&out).expect("remove");
    let refused = String::from_utf8_lossy(&drained(holds + 0.1).stderr).into_owned();
    assert!(refused.contains("cannot be drained") && refused.contains("hold"), "{refused}");
    let stderr = String::from_utf8_lossy(&drained(0.97 * holds).stderr).into_owned();
    assert!(stderr.contains("warning: ") && stderr.contains("not the result asked for"), "{stderr}");
    let summary: Value =
        serde_json::from_str(&fs::read_to_string(out.join("summary.json")).expect("summary")).expect("JSON");
    assert_eq!(summary["reliable"], false, "{summary}");
    assert!(summary["remarks"][0].as_str().is_some_and(|r| stderr.contains(r)), "{summary}");
    assert!(summary["drained_ml"]["asked"].as_f64() > Some(1.0) && summary["rollbacks"].is_u64(), "{summary}");
    let html = fs::read_to_string(out.join("report.html")).expect("report");
    assert!(html.contains("<li class=\"error\">"));
}

/// A wall that bears next to anything is passed beside the tip, and no fluid at all was "not the result asked for".
fn walls_were_passed_and_nothing_was_drained_without_a_word(case: &Path, dir: &Path) {
    let (out, tough) = (dir.join("passed"), dir.join("tough.toml"));
    fs::write(&tough, "[ventricles.insertion]\npuncture_force_mn = 20000\npuncture_depth_mm = 80\n").expect("write");
    let asked = ["--speed", "40", "--drain-ml", "0", "--materials", text(&tough)];
    let done = json(&[&["simulate", text(case), "--out", text(&out)][..], &asked].concat());
    assert_eq!((&done["reliable"], &done["reached_ventricle"]), (&Value::from(true), &Value::from(true)), "{done}");
    assert!(done["remarks"].to_string().contains("got past the wall of"), "{done}");
}

/// The insertion's own numbers are those at the target, and what came after it stands by itself.
fn a_catheter_comes_out_from_beside_another(case: &Path, alone: &Value, dir: &Path) {
    let [entry, target] = ["entry_lps_mm", "target_lps_mm"].map(|end| point(&alone["plan"][end]));
    let beside = |mm: f64| {
        let place = |p: [f64; 3]| format!("{},{},{}", p[0], p[1] - mm, p[2]);
        format!("{}:{}", place(entry), place(target))
    };
    let out = dir.join("beside");
    let asked = |path: &str| {
        let shape = ["--speed", "60", "--diameter", "2", "--tip", "cone:30", "--withdraw", "--beside", path];
        monro(&[&["simulate", text(case), "--out", text(&out)][..], &shape].concat())
    };
    let refused = asked(&beside(1.0));
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(!refused.status.success() && said.contains("mm of each other, axis to axis"), "{said}");
    let stdout = String::from_utf8_lossy(&asked(&beside(10.0)).stdout).into_owned();
    let html = fs::read_to_string(out.join("report.html")).expect("report");
    for words in ["catheter of 2 mm with a cone of 30 degrees", "another catheter beside it, from"] {
        assert!(stdout.contains(words) && html.contains(words), "{words}: {stdout}");
    }
    assert!(stdout.contains("Drawn out, held back by up to") && html.contains("Held back by up to"), "{stdout}");
    let done: Value = serde_json::from_slice(&fs::read(out.join("summary.json")).expect("summary")).expect("JSON");
    assert_eq!((&done["reached_ventricle"], &done["withdrawal"]["at_tip"]), (&true.into(), &Value::Null), "{done}");
    assert!(done["beside"][0]["at_tip"].is_string(), "{done}");
    assert!(done["tip_error_rigid_mm"].as_f64() < Some(0.01), "{done}");
    let depth = done["withdrawal"]["left_brain_depth_mm"].as_f64().expect("depth");
    assert!(depth > 0.0 && depth < done["csf"]["depth_mm"].as_f64().expect("csf"), "{done}");
    let csv = fs::read_to_string(out.join("insertion.csv")).expect("series");
    assert_eq!(csv.lines().count() as u64, done["frames"].as_u64().expect("frames") + 1);
}

/// Each of these was taken without a word.
fn registrations_by_wrong_tables_and_marks(case: &Path, dir: &Path) {
    let marks = fs::read_to_string(case.join("landmarks.mrk.json")).expect("landmarks");
    let points = monro_case::markups::decode(&marks).expect("markups");
    let row = |p: &monro_case::markups::NamedPoint| {
        format!("{},{},{},{}\n", p.label, p.position.x, p.position.y, p.position.z)
    };
    let (table, marked) = (dir.join("touched.csv"), dir.join("marked.mrk.json"));
    fs::write(&table, points.iter().take(3).map(row).collect::<String>()).expect("write");
    fs::write(&marked, marks.replace("\"coordinateSystem\"", "\"unsaid\"")).expect("write");
    let register = ["register", text(case), "--landmarks", text(&table), "--marked", text(&marked)];
    let turned = json(&register)["quaternion_wxyz"][0].as_f64().expect("w");
    assert!(turned.abs() > 0.999, "{turned}");
    let said = String::from_utf8_lossy(&monro(&register).stderr).into_owned();
    assert!(said.contains("touch another landmark"), "{said}");
    // A landmark that was not touched can be checked at.
    let fourth = &points[3];
    let check = format!("{},{},{},{}", fourth.label, fourth.position.x, fourth.position.y, fourth.position.z);
    let checked = json(&[&register[..], &["--check", &check]].concat());
    assert_eq!(checked["check"]["holds"], true, "{checked}");
    // The foramina of Monro are landmarks of a case, too.
    let inner = points.iter().filter(|p| p.label.starts_with("Monro"));
    fs::write(&table, points.iter().take(3).chain(inner).map(row).collect::<String>()).expect("write");
    let said = String::from_utf8_lossy(&monro(&register[..4]).stderr).into_owned();
    assert!(said.contains("'Monro left' by") && said.contains("nothing can touch them"), "{said}");
    fs::write(&table, points.iter().take(3).map(row).collect::<String>()).expect("write");
    a_trace_of_which_much_lies_off_the_skin_promised_more_than_the_landmarks(case, dir, &register);
    // Nasion and both of Kocher's points, left for right.
    let [nasion, left, right] = ["nasion", "Kocher left", "Kocher right"]
        .map(|label| points.iter().find(|p| p.label == label).expect("a landmark").clone());
    let exchanged = [(&nasion, &nasion), (&left, &right), (&right, &left)]
        .map(|(name, place)| row(&monro_case::markups::NamedPoint { label: name.label.clone(), ..place.clone() }));
    fs::write(&table, exchanged.concat()).expect("write");
    let told = json(&register);
    assert!(told["remarks"].to_string().contains("'Kocher left' and 'Kocher right' exchanged"), "{told}");
    fs::write(&table, points.iter().take(3).map(row).collect::<String>()).expect("write");
    let moved = |by: f64, count: usize| {
        let shift = |(i, mut p): (usize, monro_case::markups::NamedPoint)| {
            p.position.x += if i < count { by } else { 0.0 };
            p
        };
        points.iter().cloned().enumerate().map(shift).collect::<Vec<_>>()
    };
    let write = |points: &[monro_case::markups::NamedPoint]| {
        fs::write(&marked, monro_case::markups::encode(monro_case::markups::Kind::Fiducial, points)).expect("write");
    };
    write(&moved(400.0, points.len()));
    let refused = monro(&register);
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(!refused.status.success() && said.contains("lie off the skin of this head"), "{said}");
    write(&moved(400.0, 1));
    let said = String::from_utf8_lossy(&monro(&register).stderr).into_owned();
    assert!(said.contains(&format!("off the skin of this head: '{}' by", points[0].label)), "{said}");
    let second = points[1].label.as_str();
    fs::write(&marked, marks.replace(second, &points[0].label)).expect("write");
    let said = String::from_utf8_lossy(&monro(&register).stderr).into_owned();
    assert!(said.contains("is marked twice"), "{said}");
}

/// The error that was stated went into the session without a word.
fn a_trace_of_which_much_lies_off_the_skin_promised_more_than_the_landmarks(
    case: &Path,
    dir: &Path,
    register: &[&str],
) {
    let skin = monro_case::ply::decode(&fs::read(case.join("skin.ply")).expect("skin")).expect("skin");
    let top = skin.vertices.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
    let upper: Vec<_> = skin.vertices.iter().filter(|p| p.z > top - 90.0).collect();
    let trace = dir.join("trace.txt");
    let predicted = |lifted: bool| {
        let every = upper.len() / 90;
        let line = |(i, p): (usize, &&monro_geometry::Point<monro_geometry::Patient>)| {
            let up = if lifted && i % 3 == 0 { 10.0 + i as f64 / 10.0 } else { 0.0 };
            format!("{} {} {}\n", p.x, p.y, p.z + up)
        };
        fs::write(&trace, upper.iter().step_by(every).enumerate().map(line).collect::<String>()).expect("write");
        json(&[register, &["--surface", text(&trace)]].concat())
    };
    let tre = |found: &Value| found["predicted_tre_mm"].as_f64().expect("mm");
    let (alone, well, odd) = (json(register), predicted(false), predicted(true));
    assert!(tre(&well) < 0.7 * tre(&alone) && well["surface"]["doubtful"] == false, "{well}");
    assert!(tre(&odd) >= tre(&alone) && odd["surface"]["doubtful"] == true, "{odd} {alone}");
    assert_eq!(odd["session_event"]["predicted_tre_mm"], odd["predicted_tre_mm"]);
    assert!(odd["remarks"].to_string().contains("traced points lie off the skin"), "{odd}");
}

/// The one line that says how it went, beside what was warned of.
fn a_run_with_warnings_was_said_to_be_without_trouble(stdout: &str, summary: &Value) {
    let remarks = summary["remarks"].as_array().expect("remarks").len();
    let words = match (summary["reliable"].as_bool(), remarks) {
        (Some(false), _) => "NOT TO BE RELIED ON".to_owned(),
        (_, 0) => "computed without trouble".to_owned(),
        (_, remarks) => format!("computed, with {remarks} remark(s)"),
    };
    assert!(stdout.contains(&words), "{words}: {stdout}");
}

/// A run with gravity could not be told from one without.
fn what_was_asked_was_in_no_result(case: &Path, dir: &Path) {
    let (out, soft) = (dir.join("asked"), dir.join("soft.toml"));
    fs::write(&soft, "[brain]\nyoung_kpa = 1.25\n").expect("write");
    let asked = ["--speed", "80", "--gravity", "0,9.81,0", "--drain-ml", "2", "--materials", text(&soft)];
    let solver = ["--iterations", "12", "--predicted-space"];
    let done = monro(&[&["simulate", text(case), "--out", text(&out)][..], &asked, &solver].concat());
    let stdout = String::from_utf8_lossy(&done.stdout).into_owned();
    let html = fs::read_to_string(out.join("report.html")).expect("report");
    let solver = ["12 iterations in each step", "predicted deformation space"];
    for words in
        ["at 80 mm/s", "gravity 0, 9.81, 0 m/s2", "of 2.0 ml", "mmHg", "soft.toml", "1.25 kPa"].iter().chain(&solver)
    {
        assert!(stdout.contains(words), "{words}: {stdout}");
        assert!(html.contains(words), "{words} is not in the report");
    }
    assert!(stdout.contains("left side"), "{stdout}");
    the_page_gave_two_times_for_its_frames_and_hid_the_largest_shift(&html);
    paraview_could_not_show_the_head_before(&out);
    let summary: Value =
        serde_json::from_str(&fs::read_to_string(out.join("summary.json")).expect("summary")).expect("JSON");
    assert_eq!(summary["gravity_m_s2"], serde_json::json!([0.0, 9.81, 0.0]));
    a_run_with_warnings_was_said_to_be_without_trouble(&stdout, &summary);
    assert_eq!((&summary["iterations"], &summary["predicted_space"]), (&12.into(), &true.into()), "{summary}");
    let wall = ["wall_shift_mm", "max_wall_shift_mm"].map(|k| summary[k].as_f64().expect("mm"));
    assert!(wall[0] > 0.0 && wall[1] >= wall[0] && wall[1] < 20.0, "{wall:?}");
    assert!(html.contains(&format!("at most {:.1} mm on the way", wall[1])), "{wall:?}");
    assert!(summary["materials_file"].as_str().is_some_and(|f| f.ends_with("soft.toml")), "{summary}");
    assert_eq!((&summary["plan"]["side"], &summary["mode"]), (&"left".into(), &"physical".into()), "{summary}");
    assert!(summary["volumes"]["brain"]["of"].as_str().is_some_and(|of| of.contains("CSF")), "{summary}");
}

fn the_page_gave_two_times_for_its_frames_and_hid_the_largest_shift(html: &str) {
    let after = |word: &str| -> f64 {
        let (_, rest) = html.split_once(word).unwrap_or_else(|| panic!("{word} is not in the report"));
        rest.split(' ').next().and_then(|n| n.parse().ok()).unwrap_or_else(|| panic!("{word}: {rest:.20}"))
    };
    let [card, plot] = [after("99 % below "), after(">99 % ")];
    assert!((card - plot).abs() < 0.006, "{card} {plot}");
    assert!(after("at the end; at most ") > 0.0 && html.contains("under the skin, along the path"));
}

fn paraview_could_not_show_the_head_before(out: &Path) {
    let collection = fs::read_to_string(out.join("insertion.pvd")).expect("collection");
    let first = collection.lines().find(|l| l.starts_with("<DataSet")).expect("a frame");
    // With a volume to be drained, in three seconds before the insertion.
    assert_eq!(first, "<DataSet timestep=\"-3.0000\" file=\"frames/tets_000.vtu\"/>");
    let grid = monro_case::vtu::decode(&fs::read(out.join("frames/tets_000.vtu")).expect("frame")).expect("a grid");
    let moved = grid.point_data.iter().find(|d| d.name == "displacement_mm").expect("displacements");
    assert!(moved.values.iter().all(|v| *v == 0.0));
}

/// A plan read in the wrong direction, or far off the head, is refused with a hint; nothing is written.
fn plans_of_another_head(phantom: &Path, case: &Path, dir: &Path) {
    let ends = markups(&case.join("plan.mrk.json"));
    let [entry, target] = [ends[0].1, ends[1].1];
    let above = [entry[0], entry[1], entry[2] + 300.0];
    for (name, entry, target, word) in [("reversed", target, entry, "skull"), ("above", above, target, "skin")] {
        let point = |label: &str, p: [f64; 3]| serde_json::json!({ "label": label, "position": p });
        let points = [point("entry", entry), point("target", target)];
        let plan = serde_json::json!({ "markups": [{ "coordinateSystem": "LPS", "controlPoints": points }] });
        let file = dir.join(format!("{name}.mrk.json"));
        fs::write(&file, plan.to_string()).expect("write");
        let out = dir.join(name);
        let labels = case.join("labels.nii.gz");
        let arguments =
            ["prepare", text(phantom), "--labels", text(&labels), "--plan", text(&file), "--out", text(&out)];
        let said = refusal(&arguments);
        assert!(said.contains(word) && said.contains("LPS"), "{name}: {said}");
        assert!(!out.exists());
    }
}

/// A flipped byte in the mesh is found before anything is simulated.
fn damaged_case(case: &Path, dir: &Path) {
    let mesh = case.join("tets.vtu");
    let mut bytes = fs::read(&mesh).expect("mesh");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x20;
    fs::write(&mesh, bytes).expect("write");
    let out = dir.join("damaged");
    let said = refusal(&["simulate", text(case), "--out", text(&out)]);
    assert!(said.contains("tets.vtu") && said.contains("changed") && said.contains("damaged"), "{said}");
    assert!(!out.exists());
}

/// The case says how far each structure of the automatic segmentation can be trusted, and its report shows it.
fn confidence_is_kept(case: &Path) {
    let known = monro_case::Case::open(case).expect("case").manifest.confidence;
    for name in ["skull", "brain", "left_lateral_ventricle", "right_lateral_ventricle", "third_ventricle"] {
        let of = known.iter().find(|c| c.structure == name).expect(name);
        assert!((0.8..1.0).contains(&of.expected_dice), "{of:?}");
    }
    let report = fs::read_to_string(case.join("report.html")).expect("report");
    assert!(report.contains("expected Dice") && report.contains("left lateral ventricle"));
    for words in ["Euler number", "two-manifold", "all together", "Grading by distance", "0 to 0.9"] {
        assert!(report.contains(words), "{words}");
    }
}
