//! Gain over run time as a picture: a panel per scene, and one over all.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use crate::method::Method;
use crate::results::{Key, Point};
use crate::table::{geometric_mean, mean};

const PANEL: (f64, f64) = (300.0, 220.0);
const STEP: (f64, f64) = (380.0, 290.0);
const COLUMNS: usize = 3;
/// CPU seconds per megapixel shown, in powers of ten; what is beyond is drawn at the edge.
const DECADES: (f64, f64) = (-3.0, 2.0);

/// A method in a panel: CPU seconds per megapixel, gain.
type Place = (Method, f64, f64);

/// One thread; every method at the largest size that it was measured at, over the samples per pixel that were measured.
pub(crate) fn svg(points: &BTreeMap<Key, Point>) -> String {
    let scenes: BTreeSet<&str> = points.keys().map(|key| key.scene.as_str()).collect();
    let mut panels = vec![("all scenes", places(points, None))];
    for scene in scenes {
        panels.push((scene, places(points, Some(scene))));
    }
    let rows = panels.len().div_ceil(COLUMNS);
    let (width, height) = (
        60.0 + STEP.0 * COLUMNS.min(panels.len()) as f64,
        50.0 + STEP.1 * rows as f64,
    );
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    for (i, (title, places)) in panels.iter().enumerate() {
        let left = 50.0 + (i % COLUMNS) as f64 * STEP.0;
        let top = 40.0 + (i / COLUMNS) as f64 * STEP.1;
        let _ = writeln!(text, "<g transform=\"translate({left} {top})\">");
        panel(&mut text, title, places);
        text.push_str("</g>\n");
    }
    let _ = writeln!(
        text,
        "<text x=\"50\" y=\"{}\">across: CPU seconds per megapixel; up: gain, rMSE(noisy) / rMSE(denoised), geometric mean; the line joins what nothing beats in both</text>\n</svg>",
        height - 12.0
    );
    text
}

fn places(points: &BTreeMap<Key, Point>, scene: Option<&str>) -> Vec<Place> {
    let mut groups: BTreeMap<Method, (Vec<f64>, Vec<f64>)> = BTreeMap::new();
    for (key, point) in points {
        if scene.is_none_or(|scene| scene == key.scene)
            && key.threads == 1
            && let (Some(cost), Some(gain)) = (point.largest(), point.gain)
        {
            let (costs, gains) = groups.entry(key.method).or_default();
            costs.push(cost.cpu_per_megapixel);
            gains.push(gain);
        }
    }
    let groups = groups.into_iter();
    groups
        .map(|(method, (costs, gains))| (method, mean(&costs), geometric_mean(&gains)))
        .collect()
}

fn panel(text: &mut String, title: &str, places: &[Place]) {
    let top = places.iter().map(|p| p.2).fold(2.0, f64::max) * 1.1;
    let at = |cost: f64, gain: f64| {
        let decade = cost.max(1e-9).log10().clamp(DECADES.0, DECADES.1);
        (
            (decade - DECADES.0) / (DECADES.1 - DECADES.0) * PANEL.0,
            (1.0 - gain.max(0.0) / top) * PANEL.1,
        )
    };
    axes(text, title, top);
    let mut front: Vec<&Place> = places
        .iter()
        .filter(|a| !places.iter().any(|b| b.1 < a.1 && b.2 > a.2))
        .collect();
    front.sort_by(|a, b| a.1.total_cmp(&b.1));
    let line: Vec<String> = front
        .iter()
        .map(|place| at(place.1, place.2))
        .map(|(x, y)| format!("{x:.1},{y:.1}"))
        .collect();
    let _ = writeln!(
        text,
        "<polyline fill=\"none\" stroke=\"#999\" points=\"{}\"/>",
        line.join(" ")
    );
    for (method, cost, gain) in places {
        let (x, y) = at(*cost, *gain);
        let colour = colour(*method);
        let _ = writeln!(
            text,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{colour}\"/><text x=\"{:.1}\" y=\"{:.1}\" fill=\"{colour}\">{}</text>",
            x + 6.0,
            y + 12.0,
            method.name()
        );
    }
}

fn colour(method: Method) -> &'static str {
    match method {
        Method::Fast | Method::Balanced | Method::High => "#1565c0",
        Method::PerPixel | Method::Literal | Method::Wlr => "#6a1b9a",
        Method::Oidn => "#c0392b",
        _ => "#555",
    }
}

fn axes(text: &mut String, title: &str, top: f64) {
    let (width, height) = PANEL;
    let _ = writeln!(
        text,
        "<text x=\"0\" y=\"-8\" font-size=\"13\">{title}</text><rect width=\"{width}\" height=\"{height}\" fill=\"none\" stroke=\"#000\"/>"
    );
    let mut decade = DECADES.0;
    while decade <= DECADES.1 {
        let x = (decade - DECADES.0) / (DECADES.1 - DECADES.0) * width;
        let _ = writeln!(
            text,
            "<line x1=\"{x}\" x2=\"{x}\" y1=\"0\" y2=\"{height}\" stroke=\"#eee\"/><text x=\"{x}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            height + 14.0,
            10f64.powf(decade)
        );
        decade += 1.0;
    }
    for part in 0..=4 {
        let gain = top * f64::from(part) / 4.0;
        let y = (1.0 - f64::from(part) / 4.0) * height;
        let _ = writeln!(
            text,
            "<text x=\"-5\" y=\"{:.1}\" text-anchor=\"end\">{gain:.1}</text>",
            y + 4.0
        );
    }
}
