//! The device that the tests of a binary share, so that each of its pipelines is compiled once.
#![allow(dead_code, reason = "each test binary uses a part")]

use std::sync::{Arc, OnceLock};

use camsplat::engine::vulkan::{Context, ContextOptions};

/// The shared context, whose validation messages [`silent`] checks. What counts memory, or waits to be reported, opens its own.
pub fn context() -> Arc<Context> {
    static CONTEXT: OnceLock<Arc<Context>> = OnceLock::new();
    let open = || Context::new(&ContextOptions { validation: true, ..ContextOptions::default() });
    CONTEXT.get_or_init(|| open().expect("a Vulkan device and the validation layers: ./setup.sh")).clone()
}

/// Fails the test if the validation layers reported anything, of this test or of one that ran beside it.
pub fn silent(context: &Context) {
    assert_eq!(context.messages(), [""; 0], "the validation layers found fault");
}
