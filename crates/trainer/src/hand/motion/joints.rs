//! Where each joint angle stands among the 25, in the order that every file shares: the thumb's five, then five for each of index,
//! middle, ring and little. Radians; flexion positive towards the palm, abduction positive about the dorsal axis.

/// Number of joint angles of a hand.
pub const COUNT: usize = 25;

/// A finger with MCP, PIP and DIP joints, by its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finger {
    /// Index finger.
    Index = 0,
    /// Middle finger.
    Middle = 1,
    /// Ring finger.
    Ring = 2,
    /// Little finger.
    Little = 3,
}

impl Finger {
    /// All four, from the index finger on.
    pub const ALL: [Self; 4] = [Self::Index, Self::Middle, Self::Ring, Self::Little];

    const fn first(self) -> usize {
        5 + 5 * self as usize
    }

    /// Flexion at the knuckle.
    #[must_use]
    pub const fn mcp_flex(self) -> usize {
        self.first()
    }

    /// Abduction at the knuckle.
    #[must_use]
    pub const fn mcp_abd(self) -> usize {
        self.first() + 1
    }

    /// Twist at the knuckle: mostly the glove sliding on the skin.
    #[must_use]
    pub const fn mcp_twist(self) -> usize {
        self.first() + 2
    }

    /// Flexion of the middle joint.
    #[must_use]
    pub const fn pip_flex(self) -> usize {
        self.first() + 3
    }

    /// Flexion of the last joint.
    #[must_use]
    pub const fn dip_flex(self) -> usize {
        self.first() + 4
    }

    /// The three flexions, from the knuckle on.
    #[must_use]
    pub const fn flexions(self) -> [usize; 3] {
        [self.mcp_flex(), self.pip_flex(), self.dip_flex()]
    }
}

/// Flexion of the thumb's metacarpal.
pub const THUMB_CMC_FLEX: usize = 0;
/// Abduction of the thumb's metacarpal.
pub const THUMB_CMC_ABD: usize = 1;
/// Twist of the thumb's metacarpal.
pub const THUMB_CMC_TWIST: usize = 2;
/// Flexion of the thumb's knuckle.
pub const THUMB_MCP_FLEX: usize = 3;
/// Flexion of the thumb's last joint.
pub const THUMB_IP_FLEX: usize = 4;

/// The thumb's three flexions, from its root on.
pub const THUMB_FLEXIONS: [usize; 3] = [THUMB_CMC_FLEX, THUMB_MCP_FLEX, THUMB_IP_FLEX];

#[cfg(test)]
mod tests {
    use super::*;

    /// The order is fixed by the file formats; `glove` holds the same list, so the two must agree.
    #[test]
    fn the_indices_name_the_joints_of_the_shared_order() {
        let order = "thumb_cmc_flex thumb_cmc_abd thumb_cmc_twist thumb_mcp_flex thumb_ip_flex \
            index_mcp_flex index_mcp_abd index_mcp_twist index_pip_flex index_dip_flex \
            middle_mcp_flex middle_mcp_abd middle_mcp_twist middle_pip_flex middle_dip_flex \
            ring_mcp_flex ring_mcp_abd ring_mcp_twist ring_pip_flex ring_dip_flex \
            little_mcp_flex little_mcp_abd little_mcp_twist little_pip_flex little_dip_flex";
        let names: Vec<&str> = order.split_whitespace().collect();
        assert_eq!(names.len(), COUNT);
        let place = |name: String| names.iter().position(|n| **n == name);
        for (finger, name) in Finger::ALL
            .iter()
            .zip(["index", "middle", "ring", "little"])
        {
            assert_eq!(place(format!("{name}_mcp_flex")), Some(finger.mcp_flex()));
            assert_eq!(place(format!("{name}_mcp_abd")), Some(finger.mcp_abd()));
            assert_eq!(place(format!("{name}_mcp_twist")), Some(finger.mcp_twist()));
            assert_eq!(place(format!("{name}_pip_flex")), Some(finger.pip_flex()));
            assert_eq!(place(format!("{name}_dip_flex")), Some(finger.dip_flex()));
        }
        assert_eq!(place("thumb_cmc_flex".into()), Some(THUMB_CMC_FLEX));
        assert_eq!(place("thumb_cmc_abd".into()), Some(THUMB_CMC_ABD));
        assert_eq!(place("thumb_cmc_twist".into()), Some(THUMB_CMC_TWIST));
        assert_eq!(place("thumb_mcp_flex".into()), Some(THUMB_MCP_FLEX));
        assert_eq!(place("thumb_ip_flex".into()), Some(THUMB_IP_FLEX));
    }
}
