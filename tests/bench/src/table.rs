//! The points as Markdown.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use crate::method::Method;
use crate::results::{Key, Point};

type Points = BTreeMap<Key, Point>;

/// A table over all images, and one of every point.
pub(crate) fn markdown(points: &Points) -> String {
    let sizes: BTreeSet<u64> = points
        .values()
        .flat_map(|p| p.sizes.keys().copied())
        .collect();
    let mut text = String::from("## Over all images\n\n");
    text.push_str("Gain: geometric mean of rMSE(noisy) / rMSE(denoised), and the least. PSNR (tone-mapped, decibels) and HDR-FLIP: means. Times: mean over the images measured at that size (how many, in brackets).\n\n");
    heading(
        &mut text,
        "| method | threads | gain (images) | least gain | PSNR | FLIP | models per pixel |",
        &sizes,
    );
    let methods: BTreeSet<(Method, usize)> =
        points.keys().map(|key| (key.method, key.threads)).collect();
    for (method, threads) in methods {
        let of_method = points
            .iter()
            .filter(|(key, _)| key.method == method && key.threads == threads);
        let list: Vec<&Point> = of_method.map(|(_, point)| point).collect();
        overall(&mut text, method, threads, &list, &sizes);
    }
    text.push_str("\n## Every point\n\n");
    heading(
        &mut text,
        "| scene | spp | method | threads | rMSE | gain | PSNR | FLIP | models per pixel | passed through |",
        &sizes,
    );
    for (key, point) in points {
        single(&mut text, key, point, &sizes);
    }
    text
}

fn heading(text: &mut String, first: &str, sizes: &BTreeSet<u64>) {
    let mut line = first.to_owned();
    for size in sizes {
        let size = size_name(*size);
        let _ = write!(
            line,
            " CPU s/MP, {size} | wall s/MP, {size} | peak MiB, {size} |"
        );
    }
    let columns = line.matches('|').count() - 1;
    let _ = writeln!(text, "{line}\n|{}", "---|".repeat(columns));
}

fn size_name(size: u64) -> String {
    if size == 0 {
        "own size".to_owned()
    } else {
        format!("{} MP", size as f64 / 1000.0)
    }
}

fn overall(
    text: &mut String,
    method: Method,
    threads: usize,
    points: &[&Point],
    sizes: &BTreeSet<u64>,
) {
    let gains: Vec<f64> = points.iter().filter_map(|p| p.gain).collect();
    let least = gains.iter().copied().fold(f64::INFINITY, f64::min);
    let models: Vec<f64> = points.iter().filter_map(|p| p.models).collect();
    let _ = write!(
        text,
        "| {} | {threads} | {:.2} ({}) | {least:.2} | {} | {} | {} |",
        method.name(),
        geometric_mean(&gains),
        gains.len(),
        mean_of(points, |point| point.psnr, 2),
        mean_of(points, |point| point.flip, 4),
        percent((!models.is_empty()).then(|| mean(&models)))
    );
    for size in sizes {
        let costs: Vec<_> = points.iter().filter_map(|p| p.sizes.get(size)).collect();
        if costs.is_empty() {
            text.push_str(" | | |");
            continue;
        }
        let cpu: Vec<f64> = costs.iter().map(|c| c.cpu_per_megapixel).collect();
        let wall: Vec<f64> = costs.iter().map(|c| c.wall_per_megapixel).collect();
        let peak = costs.iter().map(|c| c.peak_mib).fold(0.0, f64::max);
        let (cpu, wall, count) = (mean(&cpu), mean(&wall), costs.len());
        let _ = write!(text, " {cpu:.3} ({count}) | {wall:.3} | {peak:.0} |");
    }
    text.push('\n');
}

fn single(text: &mut String, key: &Key, point: &Point, sizes: &BTreeSet<u64>) {
    let _ = write!(
        text,
        "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
        key.scene,
        key.spp,
        key.method.name(),
        key.threads,
        point.rmse.map_or_else(String::new, |v| format!("{v:.5}")),
        point.gain.map_or_else(String::new, |v| format!("{v:.2}")),
        point.psnr.map_or_else(String::new, |v| format!("{v:.2}")),
        point.flip.map_or_else(String::new, |v| format!("{v:.4}")),
        percent(point.models),
        percent(point.passed_through)
    );
    for size in sizes {
        let _ = match point.sizes.get(size) {
            Some(c) => write!(
                text,
                " {:.3} | {:.3} | {:.0} |",
                c.cpu_per_megapixel, c.wall_per_megapixel, c.peak_mib
            ),
            None => write!(text, " | | |"),
        };
    }
    text.push('\n');
}

/// The mean of a figure over the points that have it.
fn mean_of(points: &[&Point], figure: impl Fn(&Point) -> Option<f64>, digits: usize) -> String {
    let values: Vec<f64> = points.iter().filter_map(|point| figure(point)).collect();
    match values.is_empty() {
        true => String::new(),
        false => format!("{:.digits$}", mean(&values)),
    }
}

fn percent(share: Option<f64>) -> String {
    share.map_or_else(String::new, |share| format!("{:.1} %", 100.0 * share))
}

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

pub(crate) fn geometric_mean(values: &[f64]) -> f64 {
    let logs: Vec<f64> = values.iter().map(|v| v.ln()).collect();
    mean(&logs).exp()
}
