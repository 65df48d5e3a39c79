//! How far a job is, for people and for scripts.

use std::io::{IsTerminal, Write};
use std::path::Path;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle as BarStyle};
use serde::Serialize;

use super::args::ProgressStyle;

/// Shows how many of an image's rows are written.
pub(crate) struct Progress {
    file: String,
    frame: Option<u32>,
    rows: usize,
    started: Instant,
    show: Show,
}

/// How far an image is, for scripts.
#[derive(Serialize)]
struct Line<'a> {
    file: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    frame: Option<u32>,
    rows: usize,
    of: usize,
    percent: usize,
    seconds: f64,
}

enum Show {
    Nothing,
    Bar(ProgressBar),
    /// Lines at so many steps; how many have been written.
    Lines {
        steps: usize,
        written: usize,
        json: bool,
    },
}

impl Progress {
    /// Progress of an image of so many rows, which is read from `file`, and is `frame` of a sequence. Its time begins with `started`.
    pub(crate) fn new(
        style: ProgressStyle,
        rows: usize,
        file: &Path,
        frame: Option<u32>,
        started: Instant,
    ) -> Self {
        let file = file.display().to_string();
        let bar = || Show::Bar(bar(rows, file.clone()));
        let show = match style {
            ProgressStyle::Auto if std::io::stderr().is_terminal() => bar(),
            ProgressStyle::Tty => bar(),
            ProgressStyle::Plain => Show::Lines {
                steps: 10,
                written: 0,
                json: false,
            },
            ProgressStyle::Json => Show::Lines {
                steps: 100,
                written: 0,
                json: true,
            },
            ProgressStyle::Auto | ProgressStyle::None => Show::Nothing,
        };
        Self {
            file,
            frame,
            rows,
            started,
            show,
        }
    }

    /// So many rows are written.
    pub(crate) fn set(&mut self, done: usize) {
        match &mut self.show {
            Show::Nothing => {}
            Show::Bar(bar) => bar.set_position(done as u64),
            Show::Lines {
                steps,
                written,
                json,
            } => {
                let step = done * *steps / self.rows;
                if step > *written {
                    *written = step;
                    let json = *json;
                    self.write_line(done, json);
                }
            }
        }
    }

    /// A reader that went away does not stop the job.
    fn write_line(&self, rows: usize, json: bool) {
        let line = Line {
            file: &self.file,
            frame: self.frame,
            rows,
            of: self.rows,
            percent: rows * 100 / self.rows,
            seconds: self.started.elapsed().as_millis() as f64 / 1000.0,
        };
        let text = match json {
            true => serde_json::json!(line).to_string(),
            false => format!("{} % ({rows} of {} rows)", line.percent, line.of),
        };
        let _ = writeln!(std::io::stderr(), "{text}");
    }

    /// The job ended, well or not.
    pub(crate) fn end(self) {
        if let Show::Bar(bar) = self.show {
            bar.finish_and_clear();
        }
    }
}

fn bar(rows: usize, label: String) -> ProgressBar {
    let template = "{msg} {wide_bar} {percent:>3} %  {elapsed} / {duration}";
    let style = BarStyle::with_template(template).unwrap_or_else(|_| BarStyle::default_bar());
    ProgressBar::with_draw_target(Some(rows as u64), ProgressDrawTarget::stderr())
        .with_style(style)
        .with_message(label)
}
