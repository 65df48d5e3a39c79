//! Run time against error: linpred, simple filters and Open Image Denoise on the same images.

mod arguments;
mod baselines;
mod clock;
mod image;
mod machine;
mod method;
mod oidn;
mod plot;
mod point;
mod results;
mod run;
mod scenes;
mod score;
mod table;

use anyhow::Result;
use clap::Parser;

use arguments::{Arguments, Command};

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    match arguments.command {
        Some(Command::Point(point)) => {
            let measured = point::measure_point(&point)?;
            println!("{}", serde_json::to_string(&measured)?);
        }
        None => {
            let out = run::run(&arguments.run)?;
            let medians = results::medians(&results::read(&out)?);
            let table = table::markdown(&medians);
            print!("{table}");
            std::fs::write(out.join("table.md"), table)?;
            std::fs::write(out.join("plot.svg"), plot::svg(&medians))?;
            eprintln!("written to {}", out.display());
        }
    }
    Ok(())
}
