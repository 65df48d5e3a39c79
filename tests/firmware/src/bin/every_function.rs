//! Calls every function of the core but those of cells (`every_cell` has them) with values that the optimiser knows nothing of. That this links without allocator and
//! without panic is the test; it is not run.

#![no_std]
#![no_main]

#[path = "../no_panic.rs"]
mod no_panic;

use core::hint::black_box;

use cortex_m_rt::entry;
use linpred_core::{
    Averaged, COMPARED_PLANES, ColourBlock, ComparedRow, FIREFLY_ROWS, FeatureGroup, FilteredGroup,
    FinishedPlane, FrameRow, Gram, LitRow, MEASURED_PLANES, NoiseBlock, NoisyBlock,
    NormalEquations, Precisions, Prior, Rls, SMOOTHINGS, Sampler, SpeckRow, Surroundings,
    SymmetricEigen, TEMPORAL_SPAN, WeightBlock, average_frames, compare_frames, compare_light,
    compare_own, despeckle, estimate_colour_noise, estimate_feature_noise, find_factors,
    find_fireflies, level_of, measure_frame, pixel_hash, prefilter, smooth, weigh_frames,
    weigh_pixels, weigh_samples,
};

fn recursion<const T: usize>() {
    let mut fit = Rls::<T>::new(&black_box(Prior::at_centre(
        &black_box([1.0; 3]),
        black_box(1.0),
        black_box(1.0),
    )));
    let z = black_box([1.0; T]);
    let _ = black_box(fit.update(&z, &black_box([1.0; 3]), black_box(1.0)));
    let _ =
        black_box(fit.update_forgetting(&z, &black_box([1.0; 3]), black_box(1.0), black_box(0.98)));
    black_box((
        fit.predict(&z),
        fit.leverage(&z),
        fit.covariance(),
        fit.factors(),
    ));
    black_box(fit.coefficients());
}

fn normal_equations<const T: usize>() {
    let mut sums = black_box(NormalEquations::<T>::new());
    let mut gram = black_box(Gram::<T>::new());
    let z = black_box([1.0; T]);
    sums.add(&z, &black_box([1.0; 3]), black_box(1.0));
    gram.add(&z, black_box(1.0));
    let prior = black_box(Prior {
        coefficients: [[0.0; T]; 3],
        strengths: [1.0; T],
    });
    if let Ok(solution) = sums.solve(&prior) {
        black_box((
            solution.predict(&z),
            solution.leverage(&z),
            solution.trace(&gram),
        ));
        black_box((
            solution.terms(),
            solution.log_determinant(),
            sums.residual_squares(solution.coefficients()),
        ));
    }
    black_box(sums.gram());
}

fn decomposition<const D: usize>() {
    black_box(SymmetricEigen::<D>::new(&black_box([[1.0; D]; D])));
}

fn filtered<const N: usize>(group: &mut FeatureGroup<N>, filtered: &mut FilteredGroup<N>) {
    let _ = black_box(prefilter(black_box(group), black_box(filtered), None));
}

fn estimates(noisy: &mut NoisyBlock, noise: &mut NoiseBlock) {
    estimate_feature_noise(black_box(noisy), black_box(noise));
    estimate_colour_noise(black_box(noisy), black_box(noise));
}

fn fireflies(found: &mut [bool; 5]) {
    let row = black_box([1.0; 13]);
    let rows: [&[f32]; FIREFLY_ROWS] = [black_box(&row[..]); FIREFLY_ROWS];
    find_fireflies(&rows, black_box(Some(&row[..])), black_box(&mut found[..]));
}

/// The stages after the blend, on planes whose lengths nothing is known of, either.
fn finished(plane: &[f32], outputs: &mut [&mut [f32]; 5]) {
    let plane = || black_box(plane);
    let [a, b, c, d, e] = black_box(outputs);
    let pass = black_box(&SMOOTHINGS[0]);
    let input = Surroundings {
        colour: [[plane(); 3]; 3],
        error: [plane(); 5],
        level: plane(),
        noisy: plane(),
        features: [[plane(); 7]; 3],
        feature_variance: [plane(); 3],
    };
    let mut output = Precisions {
        takes_part: &mut **a,
        colour: &mut **b,
        features: [&mut **c, &mut **d, &mut **e],
    };
    weigh_pixels(pass, black_box(&input), &mut output);
    let row = ComparedRow::outside(plane());
    let mut smoothed = [FinishedPlane {
        rows: [plane(); 7],
        output: &mut **a,
    }];
    smooth(pass, black_box(&[row; 7]), &mut smoothed);
    let row = SpeckRow {
        colour: [[plane(); 3]; 3],
        noisy: plane(),
        good: plane(),
        own: plane(),
        variance: plane(),
    };
    let mut cleared = [FinishedPlane {
        rows: [plane(); 3],
        output: &mut **b,
    }];
    despeckle(black_box(&row), &mut cleared);
    let row = LitRow {
        colour: [plane(); 3],
        noisy: plane(),
        good: plane(),
        own: plane(),
        variance: plane(),
    };
    compare_light(black_box(&row), [&mut **a, &mut **b, &mut **c]);
    find_factors(black_box(&[[plane(); 33]; 3]), plane(), d);
    black_box(level_of(black_box(1.0)));
}

/// Weights and averages of neighbouring frames, on such planes.
fn frames(plane: &[f32], outputs: &mut [&mut [f32]; 5]) {
    let plane = || black_box(plane);
    let [a, b, c, ..] = black_box(outputs);
    let row = FrameRow {
        colour: [plane(); 3],
        variance: [plane(); 3],
        normal: [plane(); 3],
        albedo: [plane(); 3],
        depth: plane(),
    };
    let compared = core::array::from_fn(|_| -> &mut [f32] { &mut [] });
    compare_frames(
        black_box(&row),
        black_box(&row),
        plane(),
        black_box(compared),
    );
    let compared = core::array::from_fn(|_| -> &mut [f32] { &mut [] });
    compare_own(black_box(&row), plane(), black_box(compared));
    let mut measured = core::array::from_fn(|_| -> &mut [f32] { &mut [] });
    let rows = [[plane(); TEMPORAL_SPAN]; COMPARED_PLANES];
    measure_frame(black_box(&rows), black_box(&mut measured));
    let planes = [plane(); MEASURED_PLANES];
    let mut others = [(planes, &mut **a), (planes, &mut **b)];
    let (alike, known) = (black_box(1.0), black_box(true));
    weigh_frames(black_box(&planes), black_box(&mut others), alike, known);
    let others = black_box([(plane(), plane()); 2]);
    average_frames(plane(), &others, black_box(Averaged::Variances), c);
}

fn sampling() {
    let sampler = black_box(Sampler::default());
    let error = sampler.relative_error(black_box(1.0), black_box([1.0; 3]));
    let demand = sampler.demand(f64::from(black_box(error)), black_box(4.0));
    black_box(sampler.missing(black_box(2.0), black_box(demand), black_box(4.0)));
    black_box(sampler.expected_error(black_box(1.0), black_box(4.0), black_box(8.0)));
    black_box(pixel_hash(black_box(1), black_box(2), black_box(3)));
}

#[entry]
fn main() -> ! {
    // `entry` makes statics of a function that is called once references to them.
    static mut COLOURS: ColourBlock = ColourBlock::BLACK;
    static mut PREPARED: WeightBlock = WeightBlock::EMPTY;
    static mut TRIPLE: FeatureGroup<3> = FeatureGroup::ZERO;
    static mut FILTERED_TRIPLE: FilteredGroup<3> = FilteredGroup::ZERO;
    static mut SINGLE: FeatureGroup<1> = FeatureGroup::ZERO;
    static mut FILTERED_SINGLE: FilteredGroup<1> = FilteredGroup::ZERO;
    static mut NOISY: NoisyBlock = NoisyBlock::BLACK;
    static mut NOISE: NoiseBlock = NoiseBlock::NONE;
    static mut FIREFLIES: [bool; 5] = [false; 5];
    static mut PLANES: [[f32; 128]; 6] = [[0.0; 128]; 6];
    let [plane, a, b, c, d, e] = PLANES;
    loop {
        finished(plane, &mut [a, b, c, d, e]);
        weigh_samples(black_box(COLOURS), black_box(PREPARED));
        filtered(TRIPLE, FILTERED_TRIPLE);
        filtered(SINGLE, FILTERED_SINGLE);
        estimates(NOISY, NOISE);
        fireflies(FIREFLIES);
        frames(plane, &mut [a, b, c, d, e]);
        sampling();
        recursion::<1>();
        recursion::<5>();
        recursion::<10>();
        normal_equations::<1>();
        normal_equations::<5>();
        normal_equations::<10>();
        decomposition::<1>();
        decomposition::<9>();
        decomposition::<16>();
    }
}
