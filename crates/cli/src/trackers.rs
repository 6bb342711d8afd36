//! `monro track`, `monro fake-tracker`, `monro doctor`.

use crate::args::{in_range, rate};
use crate::console::{Console, tell};
use crate::interrupt;
use anyhow::{Context, Result, bail};
use clap::{Args, Subcommand, ValueEnum};
use monro_cli::track::{TrackOptions, track as print_poses};
use monro_guidance::clock::Expiry;
use monro_tracking::{
    Clock, Findings, IgtlFake, Motion, NatNetFake, Recorder, Scene, SceneOptions, TrackerUrl, open, run_fake_igtl,
    run_fake_natnet,
};
use monro_wire::natnet::{DATA_PORT, UpAxis, Version};
use monro_wire::openigtlink::HeaderVersion;
use serde_json::json;
use std::net::SocketAddrV4;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Nobody sets it: Ctrl-C ends the whole program.
static NEVER: AtomicBool = AtomicBool::new(false);

#[derive(Debug, Args)]
pub(crate) struct TrackArgs {
    /// `natnet://HOST[:PORT]`, `igtl://HOST[:PORT]`, `replay:FILE`, `sim:`; settings behind a `?`, with `&` between them.
    ///
    /// natnet: `interface=ADDRESS` (ours, facing the server), `multicast=GROUP`, `unicast=1`, `data_port=PORT`, `up=y|z`
    /// (Motive's up axis), `version=4.1` (read frames so, whatever the server says), `bitstream=3.0` (ask the server for it).
    /// igtl: `start=TDATA|QTDATA` (ask a server that waits to be asked).
    /// replay: `fast=1` (not at real speed), `up=y|z`, `version=4.1`.
    /// All three: `stamps=ignore` (ages count from arrival alone, where the server's clock does not keep time).
    #[arg(verbatim_doc_comment)]
    pub(crate) url: String,
    /// Stop when one tool has come so often, also where each comes in a message of its own (slower ones are then fewer).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) frames: Option<u64>,
    /// Keep what arrives (natnet, igtl) in a new file, to be played again with `replay:FILE`.
    #[arg(long, value_name = "FILE")]
    pub(crate) record: Option<PathBuf>,
    /// A pose is stale from this age on, ms.
    #[arg(long, value_name = "MS", default_value_t = 100.0, value_parser = |t: &str| in_range(t, 1.0, 3.6e6))]
    pub(crate) stale: f64,
    /// A pose is lost from this age on, ms.
    #[arg(long, value_name = "MS", default_value_t = 500.0, value_parser = |t: &str| in_range(t, 1.0, 3.6e6))]
    pub(crate) lost: f64,
}

#[derive(Debug, Args)]
pub(crate) struct DoctorArgs {
    /// As for "monro track".
    pub(crate) url: String,
    /// Tools that should be there.
    #[arg(long, value_name = "NAME")]
    pub(crate) tool: Vec<String>,
    /// How long to listen, s.
    #[arg(long, value_name = "S", default_value_t = 3.0, value_parser = |t: &str| in_range(t, 0.1, 3600.0))]
    pub(crate) listen: f64,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum MotionArg {
    /// The catheter goes to the foramen and back.
    Insertion,
    /// The stylus swings about its tip.
    Pivot,
    /// The stylus touches landmarks and strokes the skin.
    Trace,
}

#[derive(Debug, Args)]
pub(crate) struct SceneArgs {
    /// What is played.
    #[arg(long, value_enum, default_value_t = MotionArg::Insertion)]
    pub(crate) motion: MotionArg,
    /// Frames per second.
    #[arg(long, value_name = "HZ", default_value_t = 120.0, value_parser = rate)]
    pub(crate) rate: f64,
    /// Noise of a marker across the cameras' view, mm.
    #[arg(long, value_name = "MM", default_value_t = 0.12, value_parser = |t: &str| in_range(t, 0.0, 1000.0))]
    pub(crate) noise_across: f64,
    /// Noise of a marker along the cameras' view, mm.
    #[arg(long, value_name = "MM", default_value_t = 0.74, value_parser = |t: &str| in_range(t, 0.0, 1000.0))]
    pub(crate) noise_along: f64,
    /// Probability that a tool is missed in a frame.
    #[arg(long, value_name = "P", default_value_t = 0.0, value_parser = |t: &str| in_range(t, 0.0, 1.0))]
    pub(crate) dropout: f64,
    /// Frames are late by up to this, ms.
    #[arg(long, value_name = "MS", default_value_t = 0.0, value_parser = |t: &str| in_range(t, 0.0, 60_000.0))]
    pub(crate) jitter: f64,
    /// Bump the reference by 3 mm after so many seconds.
    #[arg(long, value_name = "S", value_parser = |t: &str| in_range(t, 0.0, 1e6))]
    pub(crate) bump_at: Option<f64>,
    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
}

#[derive(Debug, Subcommand)]
pub(crate) enum FakeTrackerCommand {
    /// Act as Motive.
    Natnet {
        /// Address and command port.
        #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:1510")]
        listen: SocketAddrV4,
        /// Port of the data.
        #[arg(long, value_name = "PORT", default_value_t = DATA_PORT)]
        data_port: u16,
        /// Send to each client by itself, not to a multicast group.
        #[arg(long)]
        unicast: bool,
        /// Bitstream version, 2.0 to 4.9. Those above 4.3 are announced as such, in the layout of 4.3: a server newer than
        /// tested.
        #[arg(long, value_name = "VERSION", default_value = "4.1")]
        protocol: String,
        /// Stream with z up instead of y.
        #[arg(long)]
        z_up: bool,
        #[command(flatten)]
        scene: SceneArgs,
    },
    /// Act as PLUS.
    Openigtlink {
        /// Address and port.
        #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:18944")]
        listen: SocketAddrV4,
        /// Header version, 1 or 2; version 1 has no tool status.
        #[arg(long, value_name = "VERSION", default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=2))]
        header: u8,
        #[command(flatten)]
        scene: SceneArgs,
    },
}

impl SceneArgs {
    fn scene(&self) -> Scene {
        let motion = match self.motion {
            MotionArg::Insertion => Motion::Insertion,
            MotionArg::Pivot => Motion::Pivot,
            MotionArg::Trace => Motion::Trace,
        };
        Scene::new(SceneOptions {
            motion,
            across: self.noise_across,
            along: self.noise_along,
            dropout: self.dropout,
            bump_at: self.bump_at,
            speed: 1.0,
            seed: self.seed,
        })
    }
}

/// Prints poses until their number is reached or the source ends.
pub(crate) fn track(args: &TrackArgs, json: bool) -> Result<()> {
    if args.stale >= args.lost {
        bail!("--stale {} is not below --lost {}: a pose goes stale before it is lost", args.stale, args.lost);
    }
    let url: TrackerUrl = args.url.parse()?;
    if args.record.is_some() && matches!(url, TrackerUrl::Sim | TrackerUrl::Replay(_)) {
        bail!(
            "--record keeps what a tracker sends, and {} sends nothing; record natnet://HOST or igtl://HOST (\"monro \
             fake-tracker natnet\" plays the same scene as sim:)",
            args.url
        );
    }
    let clock = Clock::new();
    let recorder = args.record.as_deref().map(|p| Recorder::create(p, clock)).transpose()?;
    let source = open(&url, clock, recorder);
    if source.is_err() {
        args.record.as_deref().map(forget_if_empty);
    }
    let mut source = source?;
    let expiry = Expiry { stale: args.stale / 1e3, lost: args.lost / 1e3 };
    // A recording says itself when it ends; a pause in it is one of the tracker's.
    let patience = match url {
        TrackerUrl::Replay(_) => Duration::MAX,
        _ => TrackOptions::default().patience,
    };
    let options = TrackOptions { frames: args.frames, json, expiry, patience };
    let (mut out, mut notes) = (std::io::stdout().lock(), std::io::stderr());
    let printed = print_poses(source.as_mut(), &options, &NEVER, &mut out, &mut notes);
    args.record.as_deref().map(forget_if_empty);
    match printed {
        // Whoever reads our output has seen enough.
        Err(e) if is_broken_pipe(&e) => Ok(()),
        other => other.map(drop),
    }
}

/// A recording in which nothing arrived is none, and would be in the way of the next.
fn forget_if_empty(recording: &Path) {
    if std::fs::metadata(recording).is_ok_and(|m| m.len() == 0) && std::fs::remove_file(recording).is_ok() {
        tell(&format!("warning: nothing arrived, so there is no recording {}", recording.display()));
    }
}

fn is_broken_pipe(e: &anyhow::Error) -> bool {
    e.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
}

/// Plays a scene until it is interrupted.
pub(crate) fn fake(command: &FakeTrackerCommand) -> Result<()> {
    let ready = |what: &'static str| {
        move |at| {
            interrupt::ends_the_command();
            tell(&format!("{what} on {at}; Ctrl-C ends it"));
        }
    };
    match command {
        FakeTrackerCommand::Natnet { listen, data_port, unicast, protocol, z_up, scene } => {
            let version = Version::parse(protocol).filter(|v| (Version::OLDEST..=Version::new(4, 9)).contains(v));
            let version = version.with_context(|| format!("--protocol {protocol} is not between 2.0 and 4.9"))?;
            let fake = NatNetFake {
                listen: *listen,
                data_port: *data_port,
                unicast: *unicast,
                version,
                rate: scene.rate,
                jitter: scene.jitter / 1e3,
                up: if *z_up { UpAxis::Z } else { UpAxis::Y },
            };
            run_fake_natnet(&fake, &mut scene.scene(), &NEVER, ready("fake Motive takes commands"))?;
        }
        FakeTrackerCommand::Openigtlink { listen, header, scene } => {
            let version = if *header == 1 { HeaderVersion::V1 } else { HeaderVersion::V2 };
            let fake = IgtlFake { listen: *listen, version, rate: scene.rate, jitter: scene.jitter / 1e3 };
            run_fake_igtl(&fake, &mut scene.scene(), &NEVER, ready("fake PLUS listens"))?;
        }
    }
    Ok(())
}

/// Says what a tracker sends, or why it does not; that is a failure, too.
pub(crate) fn doctor(args: &DoctorArgs, console: &Console) -> Result<()> {
    let mut source = open(&args.url.parse()?, Clock::new(), None)?;
    let wanted: Vec<&str> = args.tool.iter().map(String::as_str).collect();
    let Findings { mut facts, health } =
        monro_tracking::doctor(source.as_mut(), &wanted, Duration::from_secs_f64(args.listen))?;
    let found = json!({ "well": health.well, "facts": facts, "diagnosis": health.words });
    facts.extend(health.well.then(|| health.words.clone()));
    console.result(&found, &facts.join("\n"));
    if health.well { Ok(()) } else { bail!("{health}") }
}
