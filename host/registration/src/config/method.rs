//! The registration methods, one row each.

use serde::{Deserialize, Serialize};

use super::choice::choice;

/// Hands the table of methods to a macro: type of the method, type of its settings, name, the
/// motions it searches, and its line of help.
///
/// From a row follow [`Method`], [`super::MethodConfig`], [`crate::build()`] and every list of
/// methods. To add a method: its file (a type with the field `config`), its module in lib.rs, a row here, its settings in table.rs,
/// its suggestion in suggest.rs, and its row in the tests of all methods (tests.rs).
macro_rules! with_methods {
    ($callback:ident) => {
        $callback! {
            Icp IcpConfig "icp" Near
                "Point-to-plane ICP: local, starts at an initial guess";
            Gicp GicpConfig "gicp" Near
                "Generalised ICP: local, plane to plane";
            Fgr FgrConfig "fgr" Features
                "Fast global registration on FPFH features: needs no initial guess";
            Mac MacConfig "mac" Features
                "Maximal cliques of compatible FPFH matches: needs no initial guess";
            Auto AutoConfig "auto" Everywhere
                "Candidates of several scales, scored on the points of both clouds, then GICP";
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
    (
        $first:ident $_:ident $first_name:literal $first_searched:ident $first_help:literal;
        $($method:ident $config:ident $name:literal $searched:ident $help:literal;)+
    ) => {
        choice! {
            /// A registration method.
            Method {
                #[default]
                $first $first_name $first_help
                $($method $name $help)+
            }
        }

        impl Method {
            fn searched(self) -> Searched {
                match self {
                    Self::$first => Searched::$first_searched,
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
