//! The study as a picture: prediction error over condition number, a panel per case.

use std::fmt::Write as _;

use crate::report::Measured;

const COLOURS: [&str; 5] = ["#c0392b", "#e08e0b", "#2e7d32", "#1565c0", "#6a1b9a"];
const FORMS: [&str; 5] = ["covariance", "Joseph", "UD", "planar rotations", "Cholesky"];
const TITLES: [&str; 3] = [
    "361 pixels, delta 1e-3",
    "361 pixels, delta 1e-9",
    "a million updates, lambda 0.98",
];
const PANEL: (f64, f64) = (330.0, 300.0);
/// Decades of error shown; what is beyond is drawn at the edge.
const DECADES: (f64, f64) = (-16.0, 2.0);

pub(crate) fn svg(all: &[Measured]) -> String {
    let mut text = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 1150 400\" font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"1150\" height=\"400\" fill=\"white\"/>\n",
    );
    for (panel, title) in TITLES.iter().enumerate() {
        let left = 50.0 + panel as f64 * 370.0;
        let _ = writeln!(
            text,
            "<g transform=\"translate({left} 30)\"><text x=\"0\" y=\"-10\" font-size=\"13\">{title}</text>"
        );
        axes(&mut text);
        for form in all {
            if let Some(values) = series(form, panel) {
                curve(&mut text, form.name, &values);
            }
        }
        text.push_str("</g>\n");
    }
    legend(&mut text);
    text.push_str("</svg>\n");
    text
}

fn series(form: &Measured, panel: usize) -> Option<Vec<f64>> {
    let list = if panel < 2 {
        &form.rings[panel]
    } else {
        form.long.as_ref()?
    };
    Some(list.iter().map(|w| w.prediction).collect())
}

fn place(exponent: usize, error: f64) -> (f64, f64) {
    let decade = error.log10().clamp(DECADES.0, DECADES.1);
    let height = (DECADES.1 - decade) / (DECADES.1 - DECADES.0);
    (exponent as f64 / 8.0 * PANEL.0, height * PANEL.1)
}

fn axes(text: &mut String) {
    for decade in (-16..=2).step_by(2) {
        let (_, y) = place(0, 10f64.powi(decade));
        let colour = if decade == -4 { "#000" } else { "#ddd" };
        let _ = writeln!(
            text,
            "<line x1=\"0\" x2=\"{}\" y1=\"{y}\" y2=\"{y}\" stroke=\"{colour}\"/><text x=\"-6\" y=\"{}\" text-anchor=\"end\">1e{decade}</text>",
            PANEL.0,
            y + 4.0
        );
    }
    for exponent in 0..=8 {
        let (x, _) = place(exponent, 1.0);
        let _ = writeln!(
            text,
            "<text x=\"{x}\" y=\"{}\" text-anchor=\"middle\">1e{exponent}</text>",
            PANEL.1 + 16.0
        );
    }
}

/// f64 dashed, what the core ships thick, the rest thin.
fn curve(text: &mut String, name: &str, values: &[f64]) {
    let Some(form) = FORMS.iter().position(|form| {
        name.contains(form) || (name.contains("NormalEquations") && *form == "Cholesky")
    }) else {
        return;
    };
    let points: Vec<String> = values
        .iter()
        .enumerate()
        .map(|(exponent, &error)| {
            let (x, y) = place(exponent, error);
            format!("{x:.1},{y:.1}")
        })
        .collect();
    let width = if name.contains("linpred-core") {
        4.0
    } else {
        1.5
    };
    let dash = if name.ends_with("f64") {
        " stroke-dasharray=\"4 3\""
    } else {
        ""
    };
    let _ = writeln!(
        text,
        "<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\" stroke-opacity=\"0.75\"{dash} points=\"{}\"/>",
        COLOURS[form],
        points.join(" ")
    );
}

fn legend(text: &mut String) {
    for (i, (form, colour)) in FORMS.iter().zip(COLOURS).enumerate() {
        let x = 50 + i * 130;
        let _ = writeln!(
            text,
            "<line x1=\"{x}\" x2=\"{}\" y1=\"380\" y2=\"380\" stroke=\"{colour}\" stroke-width=\"3\"/><text x=\"{}\" y=\"384\">{form}</text>",
            x + 20,
            x + 25
        );
    }
    text.push_str("<text x=\"710\" y=\"384\">solid f32, dashed f64, thick: what the core ships; across: condition number; up: error of fitted values</text>\n");
}
