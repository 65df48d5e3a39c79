//! Gain, PSNR and FLIP over run time as a picture: for each of the three a panel over all scenes, and one per scene.

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

/// What is plotted upwards.
struct Measure {
    name: &'static str,
    of: fn(&Point) -> Option<f64>,
    mean: fn(&[f64]) -> f64,
    /// Whether more is better; less is better is plotted downwards.
    more: bool,
    digits: usize,
}

const MEASURES: [Measure; 3] = [
    Measure {
        name: "gain",
        of: |point| point.gain,
        mean: geometric_mean,
        more: true,
        digits: 1,
    },
    Measure {
        name: "PSNR",
        of: |point| point.psnr,
        mean,
        more: true,
        digits: 1,
    },
    Measure {
        name: "FLIP",
        of: |point| point.flip,
        mean,
        more: false,
        digits: 3,
    },
];

/// A method in a panel: CPU seconds per megapixel, and the measure.
type Place = (Method, f64, f64);

/// One thread; every method at the largest size that it was measured at, over the samples per pixel that were measured.
pub(crate) fn svg(points: &BTreeMap<Key, Point>) -> String {
    let scenes: BTreeSet<&str> = points.keys().map(|key| key.scene.as_str()).collect();
    let mut panels = Vec::new();
    for scene in std::iter::once(None).chain(scenes.into_iter().map(Some)) {
        for measure in &MEASURES {
            let title = format!("{}, {}", scene.unwrap_or("all scenes"), measure.name);
            panels.push((title, measure, places(points, scene, measure)));
        }
    }
    let rows = panels.len().div_ceil(COLUMNS);
    let (width, height) = (
        60.0 + STEP.0 * COLUMNS.min(panels.len()) as f64,
        50.0 + STEP.1 * rows as f64,
    );
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    for (i, (title, measure, places)) in panels.iter().enumerate() {
        let left = 50.0 + (i % COLUMNS) as f64 * STEP.0;
        let top = 40.0 + (i / COLUMNS) as f64 * STEP.1;
        let _ = writeln!(text, "<g transform=\"translate({left} {top})\">");
        panel(&mut text, title, measure, places);
        text.push_str("</g>\n");
    }
    let _ = writeln!(
        text,
        "<text x=\"50\" y=\"{}\">across: CPU seconds per megapixel; up is better: gain, rMSE(noisy) / rMSE(denoised), geometric mean; tone-mapped PSNR, decibels; HDR-FLIP, downwards; the line joins what nothing beats in both</text>\n</svg>",
        height - 12.0
    );
    text
}

fn places(points: &BTreeMap<Key, Point>, scene: Option<&str>, measure: &Measure) -> Vec<Place> {
    let mut groups: BTreeMap<Method, (Vec<f64>, Vec<f64>)> = BTreeMap::new();
    for (key, point) in points {
        if scene.is_none_or(|scene| scene == key.scene)
            && key.threads == 1
            && let (Some(cost), Some(value)) = (point.largest(), (measure.of)(point))
        {
            let (costs, values) = groups.entry(key.method).or_default();
            costs.push(cost.cpu_per_megapixel);
            values.push(value);
        }
    }
    let groups = groups.into_iter();
    groups
        .map(|(method, (costs, values))| (method, mean(&costs), (measure.mean)(&values)))
        .collect()
}

fn panel(text: &mut String, title: &str, measure: &Measure, places: &[Place]) {
    let range = range(measure, places);
    let at = |cost: f64, value: f64| {
        let decade = cost.max(1e-9).log10().clamp(DECADES.0, DECADES.1);
        (
            (decade - DECADES.0) / (DECADES.1 - DECADES.0) * PANEL.0,
            (1.0 - (value - range.0) / (range.1 - range.0)).clamp(0.0, 1.0) * PANEL.1,
        )
    };
    axes(text, title, range, measure.digits);
    let mut front: Vec<&Place> = places
        .iter()
        .filter(|a| {
            !places
                .iter()
                .any(|b| b.1 < a.1 && (b.2 > a.2) == measure.more && b.2 != a.2)
        })
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
    for (method, cost, value) in places {
        let (x, y) = at(*cost, *value);
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
        Method::Oidn | Method::OidnFast | Method::OidnPrefiltered | Method::OidnFastPrefiltered => {
            "#c0392b"
        }
        _ => "#555",
    }
}

/// The measure at the bottom and at the top: simple filters may be far below, and are drawn at the edge.
fn range(measure: &Measure, places: &[Place]) -> (f64, f64) {
    let values = || places.iter().map(|place| place.2);
    let (least, most) = (
        values().fold(f64::INFINITY, f64::min),
        values().fold(f64::NEG_INFINITY, f64::max),
    );
    let room = 0.05 * (most - least).max(1e-3);
    match measure.more {
        true => (least - room, most + room),
        false => (most + room, least - room),
    }
}

fn axes(text: &mut String, title: &str, (bottom, top): (f64, f64), digits: usize) {
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
        let value = bottom + (top - bottom) * f64::from(part) / 4.0;
        let y = (1.0 - f64::from(part) / 4.0) * height;
        let _ = writeln!(
            text,
            "<text x=\"-5\" y=\"{:.1}\" text-anchor=\"end\">{value:.digits$}</text>",
            y + 4.0
        );
    }
}
