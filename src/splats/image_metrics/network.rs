//! The networks whose features LPIPS compares: layer by layer, with their sizes.

/// A network with learnt weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Network {
    /// AlexNet (Krizhevsky 2014, "One weird trick for parallelizing convolutional neural networks").
    Alex,
    /// VGG16 (Simonyan and Zisserman 2015, "Very Deep Convolutional Networks for Large-Scale Image Recognition").
    Vgg,
}

/// Channels, width and height of a layer's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Channels of the layer.
    pub channels: u32,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
}

impl Size {
    /// Pixels: width times height.
    pub fn pixels(&self) -> u32 {
        self.width * self.height
    }

    /// Values: pixels times channels.
    pub fn values(&self) -> usize {
        self.channels as usize * self.width as usize * self.height as usize
    }
}

/// A convolution with a square kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Convolution {
    /// Channels of its input.
    pub from: u32,
    /// Channels of its output.
    pub to: u32,
    /// Pixels along a side of the kernel, at most 255.
    pub kernel: u32,
    /// Pixels of the input from one pixel of the output to the next.
    pub stride: u32,
    /// Rows and columns of zeros around the input.
    pub padding: u32,
}

impl Convolution {
    /// Weights of one channel of the output. The stage takes at most 32,768: it loops over them, and some drivers end an
    /// invocation's loops after 65,535 iterations.
    pub fn taps(&self) -> u32 {
        self.from * self.kernel * self.kernel
    }

    /// Size of what it makes of its input; none where the kernel does not fit.
    pub fn of(&self, size: Size) -> Option<Size> {
        let padded = |side: u32| side + 2 * self.padding;
        let side = |side| Some(padded(side).checked_sub(self.kernel)? / self.stride + 1);
        Some(Size { channels: self.to, width: side(size.width)?, height: side(size.height)? })
    }
}

/// The largest value under a square window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pool {
    /// Pixels along a side of the window.
    pub window: u32,
    /// Pixels of the input from one pixel of the output to the next.
    pub stride: u32,
}

impl Pool {
    /// Size of what it makes of its input; none where the window does not fit.
    pub fn of(&self, size: Size) -> Option<Size> {
        let side = |side: u32| Some(side.checked_sub(self.window)? / self.stride + 1);
        Some(Size { width: side(size.width)?, height: side(size.height)?, ..size })
    }
}

/// A step of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A convolution, its bias and ReLU.
    Convolve(Convolution),
    /// A max pool.
    Pool(Pool),
    /// The features that are there now are compared.
    Tap,
}

/// Layers whose features are compared, in either network.
pub(crate) const TAPS: usize = 5;

const fn convolve(from: u32, to: u32, kernel: u32, stride: u32, padding: u32) -> Step {
    Step::Convolve(Convolution { from, to, kernel, stride, padding })
}

const fn pool(window: u32) -> Step {
    Step::Pool(Pool { window, stride: 2 })
}

const ALEX: &[Step] = &[
    convolve(3, 64, 11, 4, 2),
    Step::Tap,
    pool(3),
    convolve(64, 192, 5, 1, 2),
    Step::Tap,
    pool(3),
    convolve(192, 384, 3, 1, 1),
    Step::Tap,
    convolve(384, 256, 3, 1, 1),
    Step::Tap,
    convolve(256, 256, 3, 1, 1),
    Step::Tap,
];

const VGG: &[Step] = &[
    convolve(3, 64, 3, 1, 1),
    convolve(64, 64, 3, 1, 1),
    Step::Tap,
    pool(2),
    convolve(64, 128, 3, 1, 1),
    convolve(128, 128, 3, 1, 1),
    Step::Tap,
    pool(2),
    convolve(128, 256, 3, 1, 1),
    convolve(256, 256, 3, 1, 1),
    convolve(256, 256, 3, 1, 1),
    Step::Tap,
    pool(2),
    convolve(256, 512, 3, 1, 1),
    convolve(512, 512, 3, 1, 1),
    convolve(512, 512, 3, 1, 1),
    Step::Tap,
    pool(2),
    convolve(512, 512, 3, 1, 1),
    convolve(512, 512, 3, 1, 1),
    convolve(512, 512, 3, 1, 1),
    Step::Tap,
];

impl Network {
    /// Its name in prose.
    pub fn name(self) -> &'static str {
        match self {
            Self::Alex => "AlexNet",
            Self::Vgg => "VGG16",
        }
    }

    /// Its steps, up to the last that is compared.
    pub fn steps(self) -> &'static [Step] {
        match self {
            Self::Alex => ALEX,
            Self::Vgg => VGG,
        }
    }

    /// Its convolutions in order.
    pub fn convolutions(self) -> impl Iterator<Item = Convolution> {
        self.steps().iter().filter_map(|step| match step {
            Step::Convolve(convolution) => Some(*convolution),
            _ => None,
        })
    }

    /// Channels of the features that are compared.
    pub fn taps(self) -> impl Iterator<Item = u32> {
        let mut channels = 3;
        self.steps().iter().filter_map(move |step| match step {
            Step::Convolve(convolution) => {
                channels = convolution.to;
                None
            }
            Step::Pool(_) => None,
            Step::Tap => Some(channels),
        })
    }

    /// Fewest pixels that either side of a picture may have.
    pub fn least(self) -> u32 {
        match self {
            Self::Alex => 31,
            Self::Vgg => 16,
        }
    }

    /// Sizes of a picture's values, before the first step and after each; none where the picture is too small.
    pub fn sizes(self, width: u32, height: u32) -> Option<Vec<Size>> {
        let mut sizes = vec![Size { channels: 3, width, height }];
        for step in self.steps() {
            // The list begins with the picture's own size.
            let size = *sizes.last()?;
            sizes.push(match step {
                Step::Convolve(convolution) => convolution.of(size)?,
                Step::Pool(pool) => pool.of(size)?,
                Step::Tap => size,
            });
        }
        Some(sizes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a picture that is large enough would be refused, or a smaller one reach a layer without pixels.
    #[test]
    fn the_least_side_is_the_least() {
        for network in [Network::Alex, Network::Vgg] {
            let least = network.least();
            assert!(network.sizes(least, least).is_some(), "{network:?}");
            assert!(
                network.sizes(least - 1, 1000).is_none() && network.sizes(1000, least - 1).is_none(),
                "{network:?}"
            );
        }
    }

    /// If this failed, features would be compared that the authors of the metric do not compare.
    #[test]
    fn the_features_compared_are_those_of_the_metric() {
        assert_eq!(Network::Alex.taps().collect::<Vec<_>>(), [64, 192, 384, 256, 256]);
        assert_eq!(Network::Vgg.taps().collect::<Vec<_>>(), [64, 128, 256, 512, 512]);
        assert!([Network::Alex, Network::Vgg].iter().all(|network| network.taps().count() == TAPS));
    }
}
