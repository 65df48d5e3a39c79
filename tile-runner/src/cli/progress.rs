//! How far a job is, for people and for scripts.

use std::io::{IsTerminal, Write};
use std::path::Path;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle as BarStyle};
use serde::Serialize;

use super::args::ProgressStyle;
use super::openjd;

/// Shows how many of an image's rows are written.
pub(crate) struct Progress {
    file: String,
    place: Place,
    rows: usize,
    started: Instant,
    show: Show,
}

/// An image's place among those of a command.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    /// Its number, of a sequence.
    pub(crate) frame: Option<u32>,
    /// How many images come before it.
    pub(crate) before: usize,
    /// How many there are.
    pub(crate) of: usize,
}

impl Place {
    /// The only image.
    pub(crate) const ALONE: Self = Self {
        frame: None,
        before: 0,
        of: 1,
    };

    /// How much of the command is done, in hundredths, when so many of the image's rows are. Grows over all images to 100.
    fn percent(self, done: usize, rows: usize) -> usize {
        (self.before * rows + done) * 100 / (self.of * rows)
    }
}

/// An image needs nothing done.
pub(crate) fn skipped(style: ProgressStyle, place: Place) {
    let percent = place.percent(1, 1);
    if style == ProgressStyle::Openjd && percent > place.percent(0, 1) {
        openjd::progress(percent);
    }
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
    /// Lines for the whole command; the last hundredth that was told of.
    Openjd(usize),
}

impl Progress {
    /// Progress of an image of so many rows, which is read from `file`. Its time begins with `started`.
    pub(crate) fn new(
        style: ProgressStyle,
        rows: usize,
        file: &Path,
        place: Place,
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
            ProgressStyle::Openjd => {
                openjd::status(&match place.of {
                    1 => file.clone(),
                    of => format!("{file} ({} of {of})", place.before + 1),
                });
                Show::Openjd(place.percent(0, 1))
            }
            ProgressStyle::Auto | ProgressStyle::None => Show::Nothing,
        };
        Self {
            file,
            place,
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
            Show::Openjd(told) => {
                let percent = self.place.percent(done, self.rows);
                if percent > *told {
                    *told = percent;
                    openjd::progress(percent);
                }
            }
        }
    }

    /// A reader that went away does not stop the job.
    fn write_line(&self, rows: usize, json: bool) {
        let line = Line {
            file: &self.file,
            frame: self.place.frame,
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
