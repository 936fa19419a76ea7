//! The targets without libFuzzer, on any compiler: the corpus, then bytes by proptest, for `FUZZ_SECONDS` a target.

use std::path::Path;
use std::time::{Duration, Instant};

use ipm_rs_fuzz::TARGETS;
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

/// The files of a target's corpus; a target has some, or its fuzzer begins from nothing each time.
fn corpus(name: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(name);
    let mut files: Vec<_> =
        std::fs::read_dir(&folder).expect("a folder").map(|entry| entry.expect("a file").path()).collect();
    files.sort();
    files.iter().map(|path| std::fs::read(path).expect("a file")).collect()
}

#[test]
fn every_target_holds() {
    let seconds = std::env::var("FUZZ_SECONDS").ok().and_then(|text| text.parse().ok()).unwrap_or(2);
    let only = std::env::var("FUZZ_TARGET").ok();
    for (name, run) in TARGETS.into_iter().filter(|(name, _)| only.as_deref().is_none_or(|only| only == *name)) {
        let seeds = corpus(name);
        seeds.iter().for_each(|seed| run(seed));
        let (started, mut cases) = (Instant::now(), seeds.len());
        // bytes, or those of the corpus with some changed
        let changes = prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8);
        let changed = (prop::sample::select(seeds), changes).prop_map(|(mut bytes, changes)| {
            for (index, byte) in changes {
                if !bytes.is_empty() {
                    let at = index.index(bytes.len());
                    bytes[at] = byte;
                }
            }
            bytes
        });
        let bytes = prop_oneof![prop::collection::vec(any::<u8>(), 0..400), changed];
        while started.elapsed() < Duration::from_secs(seconds) {
            // a runner is for one run; the same cases for every machine and day, more of them the longer it takes
            let mut seed = [0; 32];
            seed[..8].copy_from_slice(&(cases as u64).to_le_bytes());
            let config = Config { cases: 64, failure_persistence: None, ..Config::default() };
            let mut runner = TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &seed));
            let result = runner.run(&bytes, |bytes| {
                run(&bytes);
                Ok(())
            });
            if let Err(error) = result {
                panic!("{name}: {error}");
            }
            cases += 64;
        }
        println!("{name}: {cases} cases in {:.0} s", started.elapsed().as_secs_f64());
    }
}
