//! `monro serve`: a live insertion in the browser.

use crate::NOTICE;
use crate::args::{ModeArg, ServeArgs};
use crate::console::Console;
use crate::{interrupt, prepare, recorded, soft_body};
use anyhow::{Context, Result, bail, ensure};
use monro_case::{CASE, OutputError, Staging, check_output};
use monro_prepare::Prepared;
use monro_server::{Certificate, Invitation, Ready, Recording, ServeError, ServeOptions, Tracker};
use monro_session::ModelSettings;
use monro_tissue::FrameSettings;
use qrcode::QrCode;
use qrcode::render::unicode::Dense1x2;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// Runs the command until it is interrupted.
pub(crate) fn run(args: &ServeArgs, console: &Console) -> Result<()> {
    let case_dir = args.case.as_ref().or(args.out.as_ref()).context("give a case, or --scans and --out")?;
    let path = match &args.record {
        Some(path) => Some(path.clone()),
        None if args.no_record => None,
        None => Some(beside(case_dir)?),
    };
    let frame = args.shift.loads(args.mode)?.on(args.solver.frame());
    let skull = args.shift.skull()?;
    let model = ModelSettings { skull, ..soft_body::model(args.mode, args.materials.as_deref())? };
    soft_body::remarks(&model).iter().for_each(|r| console.warn(r));
    let settings = recorded::name(&model, &frame)?;
    let options = ServeOptions {
        case_dir: case_dir.clone(),
        listen: args.listen,
        certificate: certificate(args),
        names: args.host.clone(),
        tracker: args.tracker.parse()?,
        model,
        frame,
        recording: path.map(|path| Recording { path, settings }),
        igtl: (!args.no_igtl).then_some(args.igtl),
    };
    console.note(&format!("opening {} ...", args.scans.as_ref().unwrap_or(case_dir).display()));
    match &args.scans {
        Some(scans) => {
            ensure!(
                scans.is_dir(),
                "{}: there is no such folder; --scans wants the one with the scans",
                scans.display()
            );
            match check_output(case_dir, false, &CASE, &[scans]) {
                Err(OutputError::Exists(case)) => {
                    bail!(
                        "{0} is a case already; show it with \"monro serve {0}\", or give another --out",
                        case.display()
                    )
                }
                other => other?,
            }
            monro_server::serve_scans(scans.clone(), options, Box::new(report), |ready| announce(ready, console))
        }
        None => monro_server::serve(options, |ready| announce(ready, console)),
    }
    .map_err(not_recorded)
}

/// With what helps where nothing can be written beside a case.
fn not_recorded(error: ServeError) -> anyhow::Error {
    let is_refused = matches!(error, ServeError::Recording { .. });
    let error = anyhow::Error::from(error);
    if is_refused {
        error.context("keep the recording elsewhere with --record FILE, or none with --no-record")
    } else {
        error
    }
}

/// Writes the report of a case that was prepared in the browser.
fn report(prepared: &Prepared, stages: &[(String, f64)], staging: &Staging) -> Result<(), String> {
    let html = prepare::report(prepared, stages).map_err(|e| format!("{e:#}"))?;
    staging.write("report.html", html.as_bytes()).map_err(|e| e.to_string())
}

/// Serves the case that the demo has made, until it is interrupted.
pub(crate) fn demo(case: &Path, recording: PathBuf, console: &Console) -> Result<()> {
    let (model, frame) = (soft_body::of(ModeArg::Physical), FrameSettings::default());
    let settings = recorded::name(&model, &frame)?;
    let options = ServeOptions {
        case_dir: case.to_owned(),
        listen: ([127, 0, 0, 1], 0).into(),
        certificate: None,
        names: Vec::new(),
        tracker: Tracker::Sim,
        model,
        frame,
        recording: Some(Recording { path: recording, settings }),
        igtl: Some(([127, 0, 0, 1], 18945).into()),
    };
    monro_server::serve(options, |ready| announce(ready, console))?;
    Ok(())
}

fn certificate(args: &ServeArgs) -> Option<Certificate> {
    match (&args.cert, &args.key) {
        (Some(cert), Some(key)) => Some(Certificate::Files { cert: cert.clone(), key: key.clone() }),
        _ => args.tls.then_some(Certificate::SelfSigned),
    }
}

/// A new file in a folder beside the case, named by the present (UTC).
fn beside(case: &Path) -> Result<PathBuf> {
    let case = std::path::absolute(case)?;
    let name = case.file_name().with_context(|| format!("{} is no folder", case.display()))?.to_string_lossy();
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
    let folder = case.with_file_name(format!("{name}-sessions"));
    // Another session may have begun in the same second.
    let file =
        |n: u32| folder.join(if n > 1 { format!("{}-{n}.mnrs", date(now)) } else { format!("{}.mnrs", date(now)) });
    Ok((1..100).map(file).find(|path| !path.exists()).unwrap_or_else(|| file(1)))
}

/// Seconds since 1970 as `20261121T123456Z` (days to civil: Hinnant, "chrono-compatible low-level date algorithms").
pub(crate) fn date(seconds: u64) -> String {
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    let z = days + 719_468;
    let (era, doe) = (z / 146_097, z % 146_097);
    let yoe = (doe - doe / 1460 + doe / 36_524 - doe / 146_096) / 365;
    let doy = doe - (365 * yoe + yoe / 4 - yoe / 100);
    let shifted = (5 * doy + 2) / 153;
    let (day, month) = (doy - (153 * shifted + 2) / 5 + 1, if shifted < 10 { shifted + 3 } else { shifted - 9 });
    let year = yoe + era * 400 + u64::from(month <= 2);
    let (hour, minute) = (second / 3600, second / 60 % 60);
    format!("{year:04}{month:02}{day:02}T{hour:02}{minute:02}{:02}Z", second % 60)
}

fn announce(ready: &Ready, console: &Console) {
    interrupt::ends_the_command();
    let line = json!({
        "url": ready.url, "token": ready.token, "open": ready.browser_url(),
        "igtl": ready.igtl.map(|a| a.to_string()), "recording": ready.recording,
        "pairing_code": ready.invitation.as_ref().map(|i| &i.code), "pairing_url": ready.invitation.as_ref().map(|i| &i.url),
        "certificate_sha256": ready.invitation.as_ref().map(|i| &i.fingerprint),
    });
    let mut text = format!("Open {} in a browser on this machine (Ctrl-C ends it).", ready.browser_url());
    if let Some(invitation) = &ready.invitation {
        text += &invite(invitation);
    }
    if let Some(address) = ready.igtl {
        text += &format!("\n3D Slicer: OpenIGTLink client to {address}.");
    }
    if let Some(path) = &ready.recording {
        text += &format!("\nRecorded in {}; \"monro replay\" plays it again.", path.display());
    }
    console.result(&line, &format!("{text}\n{NOTICE}"));
}

/// How another device comes in, with a QR code to be read from the screen.
fn invite(invitation: &Invitation) -> String {
    let code = QrCode::new(invitation.url.as_bytes()).map(|c| c.render::<Dense1x2>().quiet_zone(true).build());
    format!(
        "\nAnother device: scan this, or open {} and enter the pairing code {} (good once, for ten minutes, to look).\n{}\nThe browser warns of the certificate unless it knows it; its SHA-256 is {}",
        invitation.url.split('#').next().unwrap_or_default(),
        invitation.code,
        code.unwrap_or_default(),
        invitation.fingerprint
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (seconds, wanted) in [
            (0, "19700101T000000Z"),
            (951_827_696, "20000229T123456Z"),
            (1_709_251_199, "20240229T235959Z"),
            (4_102_444_800, "21000101T000000Z"),
        ] {
            assert_eq!(date(seconds), wanted);
        }
    }
}
