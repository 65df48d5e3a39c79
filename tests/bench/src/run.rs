//! Runs the measurements, each in a process of its own.

use std::collections::HashMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use clap::ValueEnum;

use crate::arguments::RunArguments;
use crate::machine;
use crate::method::Method;
use crate::oidn;
use crate::point::Measured;
use crate::results::{Row, Rows};
use crate::scenes::{self, NoisyImage};

/// Measures everything and returns the folder of the results.
pub(crate) fn run(arguments: &RunArguments) -> Result<PathBuf> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let sample = here.join("../data");
    let images = scenes::find(
        arguments.scenes.as_deref().unwrap_or(&sample),
        &arguments.only,
        &arguments.spp,
    )?;
    let out = match &arguments.out {
        Some(out) => out.clone(),
        None => here.join("runs").join(machine::folder_name()),
    };
    std::fs::create_dir_all(&out).with_context(|| out.display().to_string())?;
    let methods = methods(&arguments.methods, &out)?;
    note_command(&out)?;
    let mut rows = Rows::append(&out)?;
    for image in &images {
        measure_image(arguments, image, &methods, &mut rows)?;
    }
    Ok(out)
}

/// The methods asked for, without Open Image Denoise where it is not installed.
fn methods(wanted: &[Method], out: &Path) -> Result<Vec<Method>> {
    let mut methods = if wanted.is_empty() {
        Method::value_variants().to_vec()
    } else {
        wanted.to_vec()
    };
    if methods.iter().any(|method| method.oidn().is_some()) {
        match oidn::version() {
            Some(version) => note(out, &version)?,
            None => {
                methods.retain(|method| method.oidn().is_none());
                eprintln!("Open Image Denoise is left out: `pip install pyoidn` for python3");
                note(out, "pyoidn: not installed, left out")?;
            }
        }
    }
    Ok(methods)
}

/// The image's own size first: its time says which of the larger sizes would take too long.
fn measure_image(
    arguments: &RunArguments,
    image: &NoisyImage,
    methods: &[Method],
    rows: &mut Rows,
) -> Result<()> {
    let mut seconds_per_pixel = HashMap::new();
    let larger = arguments.megapixels.iter().copied().filter(|m| *m > 0.0);
    let sizes = std::iter::once(0.0).chain(larger);
    for megapixels in sizes {
        // one after the other within a run, so that a slow minute of the machine meets all of them
        for run in 0..arguments.runs {
            for &method in methods {
                let rate = seconds_per_pixel.get(&method).copied().unwrap_or(0.0);
                if rate * megapixels * 1e6 > arguments.at_most {
                    if run == 0 {
                        let name = method.name();
                        eprintln!("{name} at {megapixels} MP is left out: see --at-most");
                    }
                    continue;
                }
                let measured = spawn(arguments, image, method, megapixels)?;
                let rate = measured.cost.cpu / measured.pixels as f64;
                seconds_per_pixel.insert(method, rate);
                let threads = arguments.threads.get();
                rows.add(Row::new(
                    image,
                    &method.name(),
                    megapixels,
                    threads,
                    &measured,
                ))?;
            }
        }
    }
    eprintln!("{} {} spp", image.scene, image.spp);
    Ok(())
}

fn spawn(
    arguments: &RunArguments,
    image: &NoisyImage,
    method: Method,
    megapixels: f64,
) -> Result<Measured> {
    let output = Command::new(std::env::current_exe()?)
        .arg("point")
        .arg("--image")
        .arg(&image.path)
        .arg("--reference")
        .arg(&image.reference)
        .args(["--method", &method.name()])
        .args(["--megapixels", &megapixels.to_string()])
        .args(["--threads", &arguments.threads.to_string()])
        .stderr(Stdio::inherit())
        .output()?;
    ensure!(
        output.status.success(),
        "{} on {}: {}",
        method.name(),
        image.path.display(),
        output.status
    );
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// Adds the command and where it runs to the folder's notes.
fn note_command(out: &Path) -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let line = format!(
        "{} {} {}: linpred-bench {}",
        machine::date(),
        machine::processor(),
        machine::revision(),
        arguments.join(" ")
    );
    note(out, &line)
}

fn note(out: &Path, line: &str) -> Result<()> {
    let mut file = std::fs::OpenOptions::new()
        .create(true)
        .append(true)
        .open(out.join("commands.txt"))?;
    writeln!(file, "{line}")?;
    Ok(())
}
