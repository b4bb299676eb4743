//! The cost of Eq. 13 and its seven variants of Table 1.
//!
//! HAE = mean over Q of ½‖q − g(f(q))‖² + λ1·mean ‖J‖²_F + λ2·Pin + λ3·(UCD(X, f(Q)) + α·UCD(Q, g(X))).
//! ‖J‖² has no ½ (as Eq. 2 prints it); without pairs Pin is 0. The prose under Eq. 5 swaps rows and columns, the formula is right.
//!
//! [`mod@reference`] has the plain implementation that everything fast is tested against.

pub(crate) mod engine;
pub mod fast;
pub mod reference;

use core::str::FromStr;

/// The seven costs of Table 1. [`Cost::Hae`] covers α = 0, α = 1 and, with adaptive pairs, the last row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cost {
    /// λ2·Pin.
    Pin,
    /// CAE + λ2·Pin.
    CaePin,
    /// λ2·Pin + λ3·BA.
    PinBa,
    /// λ1·‖J‖² + λ2·Pin + λ3·BA.
    DistortionPinBa,
    /// Everything (Eq. 13).
    Hae,
}

/// The coefficients λ1, λ2, λ3 and α of Eq. 13.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lambda {
    /// λ1, of the distortion.
    pub distortion: f64,
    /// λ2, of the reference pairs.
    pub pin: f64,
    /// λ3, of the boundary attraction.
    pub attraction: f64,
    /// α, of everything measured in the input domain: 0 or 1 in the paper.
    pub alpha: f64,
}

impl Lambda {
    /// The paper's for synthetic shapes, with α = 1: (0.005, 1, 5).
    pub const SHAPES: Self = Self {
        distortion: 0.005,
        pin: 1.0,
        attraction: 5.0,
        alpha: 1.0,
    };
    /// The paper's for hands, with α = 1: (0.005, 2, 5).
    pub const HAND: Self = Self {
        pin: 2.0,
        ..Self::SHAPES
    };
}

/// What one step minimises: the factor of each term. A term with factor 0 is not computed at all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Of ½‖q − g(f(q))‖².
    pub reconstruction: f64,
    /// Of ‖J‖²_F.
    pub distortion: f64,
    /// Of Pin.
    pub pin: f64,
    /// Of BA.
    pub attraction: f64,
    /// α inside Pin and BA.
    pub alpha: f64,
}

impl Cost {
    /// The terms of this cost.
    #[must_use]
    pub fn weights(self, lambda: &Lambda) -> Weights {
        let autoencoder = matches!(self, Self::CaePin | Self::Hae);
        let distortion = autoencoder || self == Self::DistortionPinBa;
        let attraction = !matches!(self, Self::Pin | Self::CaePin);
        Weights {
            reconstruction: if autoencoder { 1.0 } else { 0.0 },
            distortion: if distortion { lambda.distortion } else { 0.0 },
            pin: lambda.pin,
            attraction: if attraction { lambda.attraction } else { 0.0 },
            alpha: lambda.alpha,
        }
    }

    /// The word for it on the command line and in model files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pin => "pin",
            Self::CaePin => "cae-pin",
            Self::PinBa => "pin-ba",
            Self::DistortionPinBa => "distortion-pin-ba",
            Self::Hae => "hae",
        }
    }
}

/// A word that names no cost.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no cost is named '{0}'; use pin, cae-pin, pin-ba, distortion-pin-ba or hae")]
pub struct UnknownCost(String);

impl FromStr for Cost {
    type Err = UnknownCost;
    fn from_str(word: &str) -> Result<Self, UnknownCost> {
        [
            Self::Pin,
            Self::CaePin,
            Self::PinBa,
            Self::DistortionPinBa,
            Self::Hae,
        ]
        .into_iter()
        .find(|cost| cost.name() == word)
        .ok_or_else(|| UnknownCost(word.to_owned()))
    }
}

/// The value of each term, without its factor; 0 for a term that was not computed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parts {
    /// Mean of ½‖q − g(f(q))‖².
    pub reconstruction: f64,
    /// Mean of ‖J‖²_F.
    pub distortion: f64,
    /// Pin (Eq. 4), α inside.
    pub pin: f64,
    /// UCD(X, f(Q)).
    pub target_chamfer: f64,
    /// UCD(Q, g(X)), 0 when α is.
    pub input_chamfer: f64,
}

impl Parts {
    /// The cost: the parts times their factors.
    #[must_use]
    pub fn total(&self, weights: &Weights) -> f64 {
        weights.reconstruction * self.reconstruction
            + weights.distortion * self.distortion
            + weights.pin * self.pin
            + weights.attraction * (self.target_chamfer + weights.alpha * self.input_chamfer)
    }
}
