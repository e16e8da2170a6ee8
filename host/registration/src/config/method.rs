//! The registration methods, one row each.

use echoloop_parameters::choice;

/// Hands the table of methods to a macro: type of the method, type of its settings, name, the
/// motions it searches, and its line of help.
///
/// From a row follow [`Method`], [`super::MethodConfig`], [`crate::build()`] and every list of
/// methods. To add a method: its file, its module in lib.rs, a row here and its settings in
/// table.rs; if it is not local, its suggestion in suggest.rs. Tests of all methods (tests.rs) have
/// a row for each that is to pass them.
macro_rules! with_methods {
    ($callback:ident) => {
        $callback! {
            Icp IcpConfig "icp" Near
                "Point-to-plane ICP: local, starts at an initial guess.";
            Gicp GicpConfig "gicp" Near
                "Generalised ICP: local, plane to plane.";
            Fgr FgrConfig "fgr" Features
                "Fast global registration on FPFH features: needs no initial guess.";
            Mac MacConfig "mac" Features
                "Maximal cliques of compatible FPFH matches: needs no initial guess.";
            Auto AutoConfig "auto" Everywhere
                "Candidates of some scales, scored on both clouds' points, then GICP and ICP.";
        }
    };
}

pub(crate) use with_methods;

/// The motions that a method searches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Searched {
    /// Motions near the initial guess.
    Near,
    /// All motions, by matches of features. The result is good to some decimetres.
    Features,
    /// All motions. The result is as good as a local method's.
    Everywhere,
}

macro_rules! declare {
    ($($method:ident $config:ident $name:literal $searched:ident $help:literal;)+) => {
        choice! {
            /// A registration method.
            pub enum Method by default Icp {
                $(#[doc = $help] $method = $name,)+
            }
        }

        impl Method {
            fn searched(self) -> Searched {
                match self {
                    $(Self::$method => Searched::$searched,)+
                }
            }
        }
    };
}

with_methods!(declare);

impl Method {
    /// True when it takes no initial guess and leaves the last decimetres to a local method.
    pub fn is_rough(self) -> bool {
        self.has_features()
    }

    /// True when it searches all motions, and so needs no initial guess.
    pub fn is_global(self) -> bool {
        self.searched() != Searched::Near
    }

    /// True when it has the settings of features.
    pub(super) fn has_features(self) -> bool {
        self.searched() == Searched::Features
    }
}
