//! Baselines at the size of an evaluation.

use super::kind::Kind;
use super::settings::EvaluationSettings;
use crate::lab::baselines::manifold;
use crate::lab::baselines::request::BaselineRequest;
use crate::planner::select::retrained;

/// Side of the pictures that a method trains on while it chooses, at most, in pixels.
const SIDE: u32 = 400;
/// One of so many iterations, and of so many splats, that a training on the chosen views has, goes into choosing them.
const ITERATIONS: u32 = 3;
const SPLATS: u32 = 5;
/// Iterations of training with which a camera takes the published number of steps.
const WHOLE: f64 = 30_000.0;

/// A request whose costs fit the evaluation: what a method trains between its choices is a part of what is trained on them.
pub(crate) fn sized(request: BaselineRequest, kind: Kind, settings: &EvaluationSettings) -> BaselineRequest {
    let fit = |published: retrained::RetrainingSettings| {
        let sized = retrained::RetrainingSettings {
            max_splats: (settings.max_splats / SPLATS).max(1),
            shrink: settings.size.div_ceil(SIDE),
            background: kind.background(),
            antialiased: settings.antialiased,
            ..published
        };
        sized.within(settings.iterations / ITERATIONS, request.views)
    };
    let ascent = |published: manifold::ManifoldSettings| {
        let share = f64::from(settings.iterations) / WHOLE;
        let steps = (f64::from(published.steps) * share).round() as u32;
        manifold::ManifoldSettings { steps: steps.clamp(1, published.steps), ..published }
    };
    BaselineRequest { retraining: request.retraining.map(fit), manifold: request.manifold.map(ascent), ..request }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner::methods::Method;
    use crate::planner::plan::config::{Config, Preset};
    use crate::splats::config::Background;

    /// If this failed, a method would train over another background while it chooses than what it chooses is trained over.
    #[test]
    fn what_a_method_trains_is_like_what_is_trained() {
        let request = BaselineRequest::new(Method::FisherRetrain, None, &Config::new(Preset::Room, 20)).unwrap();
        for (kind, background) in [(Kind::Room, Background::Black), (Kind::Object, Background::White)] {
            let retraining = sized(request.clone(), kind, &EvaluationSettings::QUICK).retraining.unwrap();
            assert_eq!((retraining.background, retraining.max_splats), (background, 1000));
        }
    }
}
