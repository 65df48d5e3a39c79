//! The study as tables.

use std::fmt::Write as _;
use std::fs;

use crate::DELTAS;
use crate::measure::Worst;

/// What was measured of one form; each list runs over condition numbers 10^0 to 10^8.
pub(crate) struct Measured {
    pub(crate) name: &'static str,
    /// Windows of 361 pixels, for each of the prior strengths.
    pub(crate) rings: [Vec<Worst>; 2],
    /// The long run with forgetting, of forms that know it.
    pub(crate) long: Option<Vec<Worst>>,
    pub(crate) nanoseconds: f64,
}

pub(crate) fn csv(all: &[Measured]) -> String {
    let mut text = String::from(
        "form,case,condition_exponent,prediction_error,prediction_error_last_ring,coefficient_error,asymmetric_share,indefinite_share,ns_per_model\n",
    );
    for form in all {
        let windows = DELTAS
            .iter()
            .zip(&form.rings)
            .map(|(d, w)| (format!("361 pixels delta {d:e}"), w));
        let long = form
            .long
            .iter()
            .map(|w| ("1e6 updates lambda 0.98".to_owned(), w));
        for (case, list) in windows.chain(long) {
            for (exponent, w) in list.iter().enumerate() {
                let Worst {
                    prediction,
                    last_prediction,
                    coefficients,
                    asymmetric,
                    indefinite,
                } = w;
                let _ = writeln!(
                    text,
                    "{},{case},{exponent},{prediction:e},{last_prediction:e},{coefficients:e},{asymmetric},{indefinite},{:.0}",
                    form.name.replace(',', ";"),
                    form.nanoseconds,
                );
            }
        }
    }
    text
}

pub(crate) fn markdown(all: &[Measured]) -> String {
    let mut text = format!(
        "Machine: {}. `cargo run --release -p linpred-tests --bin stability -- FOLDER`.\n",
        machine()
    );
    for (i, delta) in DELTAS.iter().enumerate() {
        section(
            &mut text,
            &format!("Prediction error, worst of rings 1 to 9, 30 windows, delta {delta:e}"),
            all,
            |form| Some(form.rings[i].iter().map(|w| w.prediction).collect()),
        );
        section(
            &mut text,
            &format!("Prediction error, 361 pixels, delta {delta:e}"),
            all,
            |form| Some(form.rings[i].iter().map(|w| w.last_prediction).collect()),
        );
        section(
            &mut text,
            &format!("Coefficient error, worst of rings 1 to 9, delta {delta:e}"),
            all,
            |form| Some(form.rings[i].iter().map(|w| w.coefficients).collect()),
        );
        section(
            &mut text,
            &format!("Share of updates after which P is indefinite, delta {delta:e}"),
            all,
            |form| holds_p(form).then(|| form.rings[i].iter().map(|w| w.indefinite).collect()),
        );
    }
    section(
        &mut text,
        "Share of updates after which P is not symmetric to the bit, delta 1e-3",
        all,
        |form| holds_p(form).then(|| form.rings[0].iter().map(|w| w.asymmetric).collect()),
    );
    section(
        &mut text,
        "Prediction error, a million updates with lambda 0.98, worst of a hundred comparisons",
        all,
        |form| Some(form.long.as_ref()?.iter().map(|w| w.prediction).collect()),
    );
    section(
        &mut text,
        "Coefficient error, a million updates with lambda 0.98",
        all,
        |form| Some(form.long.as_ref()?.iter().map(|w| w.coefficients).collect()),
    );
    text.push_str("\n## Time of a model: 361 updates, coefficients at nine ring ends\n\n| form | ns |\n|---|---|\n");
    for form in all.iter().filter(|form| form.nanoseconds.is_finite()) {
        let _ = writeln!(text, "| {} | {:.0} |", form.name, form.nanoseconds);
    }
    text
}

fn holds_p(form: &Measured) -> bool {
    ["UD", "covariance", "Joseph"]
        .iter()
        .any(|word| form.name.contains(word))
}

fn section(
    text: &mut String,
    title: &str,
    all: &[Measured],
    values: impl Fn(&Measured) -> Option<Vec<f64>>,
) {
    let _ = write!(
        text,
        "\n## {title}\n\n| form | 1e0 | 1e1 | 1e2 | 1e3 | 1e4 | 1e5 | 1e6 | 1e7 | 1e8 |\n|---|---|---|---|---|---|---|---|---|---|\n"
    );
    for form in all {
        if let Some(values) = values(form) {
            let cells: Vec<String> = values
                .iter()
                .map(|v| {
                    if *v == 0.0 {
                        "0".to_owned()
                    } else {
                        format!("{v:.1e}")
                    }
                })
                .collect();
            let _ = writeln!(text, "| {} | {} |", form.name, cells.join(" | "));
        }
    }
}

/// The processor's name, where the system tells.
fn machine() -> String {
    let info = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = info
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    name.map_or_else(
        || std::env::consts::ARCH.to_owned(),
        |(_, name)| name.trim().to_owned(),
    )
}
