#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| ipm_rs_fuzz::tables::run(data));
