//! A host of the library: its images, and its calls without the ceremony.

use std::ffi::{CStr, CString, c_void};
use std::ptr::{null, null_mut};

use linpred_c::linpred_status::{self, LINPRED_OK};
use linpred_c::{
    linpred_denoiser, linpred_execute, linpred_free, linpred_get_report, linpred_layout,
    linpred_message, linpred_new, linpred_next_step, linpred_options, linpred_progress_function,
    linpred_report, linpred_row_functions, linpred_run_rows, linpred_sample_goal,
    linpred_sample_map, linpred_sample_summary, linpred_set_image, linpred_set_options,
    linpred_set_output, linpred_set_progress, linpred_start_rows, linpred_status_text,
    linpred_step, linpred_stop_rows, linpred_unset_image, linpred_unset_output,
};

pub(crate) const WIDTH: usize = 41;
pub(crate) const HEIGHT: usize = 30;

pub(crate) const FLOAT: i32 = 1;
pub(crate) const FLOAT3: i32 = 3;
pub(crate) const FLOAT4: i32 = 4;
pub(crate) const HALF3: i32 = 259;

/// A number from 0 to 1 that looks random.
pub(crate) fn random(seed: usize, n: usize) -> f32 {
    let mut n = (n as u32).wrapping_mul(0x9E37_79B9) ^ (seed as u32).wrapping_mul(0x85EB_CA6B);
    n = (n ^ (n >> 16)).wrapping_mul(0x7FEB_352D);
    n = (n ^ (n >> 15)).wrapping_mul(0x846C_A68B);
    ((n ^ (n >> 16)) >> 8) as f32 / 16_777_216.0
}

/// Random pixels of so many numbers each.
pub(crate) fn pixels(seed: usize, numbers: usize) -> Vec<f32> {
    (0..WIDTH * HEIGHT * numbers)
        .map(|n| random(seed, n))
        .collect()
}

pub(crate) fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// Arguments after the format.
#[derive(Clone, Copy, Default)]
pub(crate) struct At {
    pub(crate) byte_offset: usize,
    pub(crate) pixel_stride: usize,
    pub(crate) row_stride: usize,
}

/// A denoiser with quality FAST, on two threads.
pub(crate) struct Host(pub(crate) *mut linpred_denoiser);

impl Drop for Host {
    fn drop(&mut self) {
        // SAFETY: of `linpred_new`, or NULL
        unsafe { linpred_free(&raw mut self.0) };
        assert!(self.0.is_null());
    }
}

impl Host {
    pub(crate) fn new() -> Self {
        let host = Self(linpred_new());
        host.options(|options| (options.quality, options.threads) = (4, 2))
            .ok();
        host
    }

    /// What a call returned, and the message after it.
    fn told(&self, status: linpred_status) -> Told {
        // SAFETY: of `linpred_new`, or NULL; the text stays until the next call
        let message = unsafe { CStr::from_ptr(linpred_message(self.0)) };
        Told(status, message.to_str().unwrap().to_owned())
    }

    pub(crate) fn options(&self, change: impl FnOnce(&mut linpred_options)) -> Told {
        let mut options = linpred_options {
            struct_size: size_of::<linpred_options>(),
            quality: 0,
            formulas: 0,
            coverage: 0,
            threads: 0,
            memory_limit: 0,
        };
        change(&mut options);
        // SAFETY: it can be read over any size that tests state
        self.told(unsafe { linpred_set_options(self.0, &raw const options) })
    }

    /// Sets an image without checking that the pixels are there.
    pub(crate) fn set(
        &self,
        name: &str,
        data: *const c_void,
        format: i32,
        size: (usize, usize),
        at: At,
    ) -> Told {
        let name = CString::new(name).unwrap();
        let (width, height) = size;
        let (pixel, row) = (at.pixel_stride, at.row_stride);
        // SAFETY: the name ends with a zero; tests execute with pixels that are there
        self.told(unsafe {
            linpred_set_image(
                self.0,
                name.as_ptr(),
                data,
                format,
                width,
                height,
                at.byte_offset,
                pixel,
                row,
            )
        })
    }

    /// Sets an image of the usual size.
    pub(crate) fn image(&self, name: &str, pixels: &[f32], format: i32) -> Told {
        self.set(
            name,
            pixels.as_ptr().cast(),
            format,
            (WIDTH, HEIGHT),
            At::default(),
        )
    }

    pub(crate) fn set_output(
        &self,
        name: &str,
        data: *mut c_void,
        format: i32,
        size: (usize, usize),
        at: At,
    ) -> Told {
        let name = CString::new(name).unwrap();
        let (width, height) = size;
        let (pixel, row) = (at.pixel_stride, at.row_stride);
        // SAFETY: the name ends with a zero; tests execute with pixels that are there
        self.told(unsafe {
            linpred_set_output(
                self.0,
                name.as_ptr(),
                data,
                format,
                width,
                height,
                at.byte_offset,
                pixel,
                row,
            )
        })
    }

    pub(crate) fn output(&self, name: &str, pixels: &mut [f32], format: i32) -> Told {
        self.set_output(
            name,
            pixels.as_mut_ptr().cast(),
            format,
            (WIDTH, HEIGHT),
            At::default(),
        )
    }

    pub(crate) fn unset_image(&self, name: &str) {
        let name = CString::new(name).unwrap();
        // SAFETY: the name ends with a zero
        self.told(unsafe { linpred_unset_image(self.0, name.as_ptr()) })
            .ok();
    }

    pub(crate) fn unset_output(&self, name: &str) {
        let name = CString::new(name).unwrap();
        // SAFETY: the name ends with a zero
        self.told(unsafe { linpred_unset_output(self.0, name.as_ptr()) })
            .ok();
    }

    pub(crate) fn progress(&self, function: linpred_progress_function, user: *mut c_void) -> Told {
        // SAFETY: tests give functions that can be called so
        self.told(unsafe { linpred_set_progress(self.0, function, user) })
    }

    pub(crate) fn execute(&self) -> Told {
        // SAFETY: tests set pixels that are there
        self.told(unsafe { linpred_execute(self.0) })
    }

    pub(crate) fn sample_map_to(
        &self,
        goal: &linpred_sample_goal,
        map: *mut u32,
        size: (usize, usize),
        at: At,
        summary: *mut linpred_sample_summary,
    ) -> Told {
        let (width, height) = size;
        let (pixel, row) = (at.pixel_stride, at.row_stride);
        // SAFETY: the structs have room, whatever sizes tests state; the map lies where it can be written, or is refused
        self.told(unsafe {
            linpred_sample_map(
                self.0,
                goal,
                map,
                width,
                height,
                at.byte_offset,
                pixel,
                row,
                summary,
            )
        })
    }

    /// The map of an image of the usual size.
    pub(crate) fn sample_map(
        &self,
        goal: &linpred_sample_goal,
        map: &mut [u32],
    ) -> (Told, linpred_sample_summary) {
        assert_eq!(map.len(), WIDTH * HEIGHT);
        let mut summary = no_summary();
        let at = At::default();
        let told = self.sample_map_to(
            goal,
            map.as_mut_ptr(),
            (WIDTH, HEIGHT),
            at,
            &raw mut summary,
        );
        (told, summary)
    }

    pub(crate) fn report(&self) -> (Told, linpred_report) {
        let mut report = linpred_report {
            struct_size: size_of::<linpred_report>(),
            pixels: 0,
            passed_through: 0,
            repaired: 0,
            fireflies: 0,
            estimated: 0,
            cells: 0,
            cells_skipped: 0,
            feature_blocks: 0,
            feature_blocks_skipped: 0,
            models: 0,
            clamped: 0,
            fitting_seconds: 0.0,
        };
        // SAFETY: it has the size that it states
        let status = unsafe { linpred_get_report(self.0, &raw mut report) };
        (self.told(status), report)
    }

    pub(crate) fn start_rows(&self, layout: &linpred_layout) -> Told {
        // SAFETY: it has the size that it states
        self.told(unsafe { linpred_start_rows(self.0, layout) })
    }

    pub(crate) fn run_rows(
        &self,
        layout: &linpred_layout,
        functions: &linpred_row_functions,
    ) -> Told {
        // SAFETY: they have the sizes that they state, and tests give functions that can be called so
        self.told(unsafe { linpred_run_rows(self.0, layout, functions) })
    }

    /// The next step; the message would take its rows back.
    pub(crate) fn next(&self, step: &mut linpred_step) -> linpred_status {
        // SAFETY: it has the size that it states
        unsafe { linpred_next_step(self.0, step) }
    }

    pub(crate) fn next_told(&self) -> Told {
        let status = self.next(&mut no_step());
        self.told(status)
    }

    pub(crate) fn stop_rows(&self) -> Told {
        // SAFETY: of `linpred_new`
        self.told(unsafe { linpred_stop_rows(self.0) })
    }
}

pub(crate) fn no_step() -> linpred_step {
    linpred_step {
        struct_size: size_of::<linpred_step>(),
        kind: 0,
        reserved: 0,
        wanted: null(),
        denoised: null(),
    }
}

/// An image with a colour alone.
pub(crate) fn layout() -> linpred_layout {
    linpred_layout {
        struct_size: size_of::<linpred_layout>(),
        width: WIDTH,
        height: HEIGHT,
        variance: 0,
        normal: 0,
        albedo: 0,
        depth: 0,
        alpha: 0,
        layers: 0,
        scalars: 0,
        further_with_variance: 0,
        further: [0; 6],
    }
}

pub(crate) fn goal(budget: f64, target_error: f64) -> linpred_sample_goal {
    linpred_sample_goal {
        struct_size: size_of::<linpred_sample_goal>(),
        budget,
        target_error,
    }
}

pub(crate) fn no_summary() -> linpred_sample_summary {
    linpred_sample_summary {
        struct_size: size_of::<linpred_sample_summary>(),
        pixels: 0,
        samples: 0,
        added: 0,
        most: 0,
        reserved: 0,
        error: 0.0,
        error_then: 0.0,
    }
}

pub(crate) fn no_functions() -> linpred_row_functions {
    linpred_row_functions {
        struct_size: size_of::<linpred_row_functions>(),
        user: null_mut(),
        read_row: None,
        write_row: None,
    }
}

/// A code and the message that came with it.
#[derive(Debug, PartialEq)]
pub(crate) struct Told(pub(crate) linpred_status, pub(crate) String);

impl Told {
    #[track_caller]
    pub(crate) fn ok(self) {
        assert_eq!(self, Self(LINPRED_OK, "no error".into()));
    }

    /// Asserts that it failed so, in a sentence of its own that holds these words.
    #[track_caller]
    pub(crate) fn fails(&self, status: linpred_status, words: &str) {
        assert!(
            self.0 == status && self.1.contains(words),
            "{self:?}, not {status:?} with {words:?}"
        );
        // SAFETY: it stays where it is
        let general = unsafe { CStr::from_ptr(linpred_status_text(status as i32)) };
        assert!(!general.is_empty() && self.1.len() > 10, "{self:?}");
    }
}
