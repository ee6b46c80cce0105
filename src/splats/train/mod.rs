//! Iterations on the device: loss, gradients, Adam, growth within a budget.

pub(crate) mod density;
mod epoch_sampler;
pub mod exposure;
pub mod loss;
pub mod mcmc;
pub mod memory;
pub mod poses;
pub mod read_back;
mod test_poses;
pub mod trainer;
pub mod update;
