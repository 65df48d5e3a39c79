//! How far a job is, for people and for scripts.

use std::io::{IsTerminal, Write};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle as BarStyle};

use super::args::ProgressStyle;

/// Shows how many of an image's rows are written.
pub(crate) struct Progress {
    rows: usize,
    show: Show,
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
    /// Progress of an image of so many rows; `label` names it.
    pub(crate) fn new(style: ProgressStyle, rows: usize, label: String) -> Self {
        let show = match style {
            ProgressStyle::Auto if std::io::stderr().is_terminal() => Show::Bar(bar(rows, label)),
            ProgressStyle::Tty => Show::Bar(bar(rows, label)),
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
        Self { rows, show }
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
                    line(done, self.rows, *json);
                }
            }
        }
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

/// A reader that went away does not stop the job.
fn line(done: usize, rows: usize, json: bool) {
    let percent = done * 100 / rows;
    let mut stderr = std::io::stderr().lock();
    let _ = match json {
        true => writeln!(
            stderr,
            "{{\"rows\":{done},\"of\":{rows},\"percent\":{percent}}}"
        ),
        false => writeln!(stderr, "{percent} % ({done} of {rows} rows)"),
    };
}
