//! What is done to the patient's fluid while the session runs, and gravity.

use crate::common::{options, sliding as sliding_model, write_case};
use crate::recording::{played_as, watch};
use crate::{Served, serve};
use monro_server::{Recording, ServeOptions, start};
use monro_session::{Csf, Loads};
use serde_json::Value;
use std::path::PathBuf;

/// A brain that slides, drained and under gravity from the start where `loads` says so.
fn sliding(case: PathBuf, loads: Loads) -> ServeOptions {
    let usual = options(case);
    ServeOptions { model: sliding_model(), frame: loads.on(usual.frame), ..usual }
}

async fn served(loads: Loads) -> Served {
    let dir = tempfile::tempdir().expect("temp");
    let case = write_case(dir.path(), false);
    Served { running: start(sliding(case, loads)).await.expect("start"), _dir: dir }
}

fn number(v: &Value, field: &str) -> f64 {
    v[field].as_f64().unwrap_or(f64::NAN)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_ventricles_are_drained_while_the_session_runs_and_filled_again() {
    let served = served(Loads::default()).await;
    let rest = served.get("/api/tissue").await;
    assert_eq!((&rest["skull"], &rest["drain_ml"]), (&"slides".into(), &Value::Null));
    assert!(served.get("/api/guidance").await["drained_asked_ml"].is_null());
    // Nobody is seen: the tissue moves all the same.
    assert_eq!(served.post("/api/tracker", r#"{"paused":true}"#).await.0, 200);
    served.until(|g| g["state"] == "lost").await;
    let (status, now) = served.post("/api/tissue", r#"{"drain_ml":6,"gravity_m_s2":[0,4.9,0]}"#).await;
    assert_eq!((status, number(&now, "drain_ml"), &now["gravity_m_s2"][1]), (200, 6.0, &4.9.into()));
    let drained = served.until(|g| (number(g, "drained_ml") - 6.0).abs() < 0.1).await;
    assert_eq!(number(&drained, "drained_asked_ml"), 6.0);
    assert!(
        number(&drained, "csf_pressure_change_mmhg") < 0.0 && number(&drained, "target_shift_mm") > 0.2,
        "{drained}"
    );
    // What is not said stays.
    let (_, now) = served.post("/api/tissue", r#"{"drain_ml":0}"#).await;
    assert_eq!((number(&now, "drain_ml"), &now["gravity_m_s2"][1]), (0.0, &4.9.into()));
    served.until(|g| number(g, "drained_ml").abs() < 0.1).await;
    // Nothing any more.
    let (_, now) = served.post("/api/tissue", r#"{"drain_ml":null,"gravity_m_s2":null}"#).await;
    assert!(now["drain_ml"].is_null() && now["gravity_m_s2"][1] == 0.0, "{now}");
    served.until(|g| g["drained_asked_ml"].is_null() && number(g, "target_shift_mm") < 0.05).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_no_head_bears_is_refused_and_changes_nothing() {
    let served = served(Loads { csf: Csf::Drained { ml: 2.0 }, ..Loads::default() }).await;
    // On from the start.
    let first = served.get("/api/guidance").await;
    assert!((number(&first, "drained_ml") - 2.0).abs() < 0.1, "{first}");
    for (bad, wanted) in [
        (r#"{"drain_ml":1e9}"#, 422),
        (r#"{"drain_ml":149}"#, 422),
        (r#"{"drain_ml":3,"csf_pressure_mmhg":1}"#, 422),
        (r#"{"csf_pressure_mmhg":-151}"#, 422),
        (r#"{"gravity_m_s2":[0,9810,0]}"#, 422),
        (r#"{"gravity_m_s2":[0,9.81]}"#, 422),
        (r#"{"drained":3}"#, 422),
        ("{", 400),
    ] {
        let (status, said) = served.post("/api/tissue", bad).await;
        assert_eq!(status, wanted, "{bad}: {said}");
        assert!(said["error"].as_str().is_some_and(|e| !e.is_empty()), "{bad}");
    }
    assert_eq!(number(&served.get("/api/tissue").await, "drain_ml"), 2.0);
    let paper = serve(false).await;
    let (status, said) = paper.post("/api/tissue", r#"{"drain_ml":3}"#).await;
    assert!(status == 409 && said["error"].as_str().is_some_and(|e| e.contains("physical")), "{said}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_session_with_brain_shift_replays_bit_for_bit() {
    let dir = tempfile::tempdir().expect("temp");
    let (case, file) = (write_case(dir.path(), false), dir.path().join("shift.mnrs"));
    let loads = Loads { csf: Csf::AtRest, gravity_mm_s2: [0.0, 0.0, -2000.0] };
    let recording = Some(Recording { path: file.clone(), settings: "shift".into() });
    let settings = sliding(case.clone(), loads);
    let (model, frame) = (settings.model, settings.frame);
    let running = start(ServeOptions { recording, ..settings }).await.expect("start");
    let served = Served { running, _dir: dir };
    let ready = served.running.ready().clone();
    watch(&ready.url, &ready.token, "next", 30, |_| true).await;
    assert_eq!(served.post("/api/tissue", r#"{"drain_ml":4}"#).await.0, 200);
    watch(&ready.url, &ready.token, "next", 30, |g| number(g, "drained_ml") > 3.0).await;
    // On while nobody is seen, too.
    served.post("/api/tracker", r#"{"paused":true}"#).await;
    served.until(|g| g["state"] == "lost").await;
    assert_eq!(served.post("/api/tissue", r#"{"drain_ml":1}"#).await.0, 200);
    let seen = watch(&ready.url, &ready.token, "next", 10, |g| number(g, "drained_ml") < 2.0).await;
    let Served { running, _dir } = served;
    drop(running);
    tokio::time::sleep(std::time::Duration::from_millis(200)).await;
    let (done, shown) = played_as(&file, None, |_| Some((model, frame))).expect("replay");
    assert!(done.identical == done.snapshots && done.snapshots >= 70 && done.differs_at_s.is_none(), "{done:?}");
    assert!(seen.iter().all(|g| shown.contains(g)));
    // The loads count.
    let (other, _) = played_as(&file, None, |_| Some((model, Loads::default().on(frame)))).expect("replay");
    assert!(other.identical < other.snapshots, "{other:?}");
}
