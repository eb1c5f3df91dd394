//! Random dimensions: the numbers that tell apart what a path draws random numbers for. No two uses share one.

macro_rules! dimensions {
    ($($(#[doc = $doc:literal])+ $name:ident = $value:literal;)+) => {
        $($(#[doc = $doc])+ pub const $name: u64 = $value;)+
        #[cfg(test)]
        const ALL: &[u64] = &[$($name),+];
    };
}

dimensions! {
    /// Random dimension of directions toward the sky.
    SKY_DIRECTION = 1;
    /// Random dimension of the ends of rays toward the sky.
    SKY_DISTANCE = 2;
    /// Random dimension of directions toward suns.
    SUN_DIRECTION = 3;
    /// Random dimension of directions toward environments.
    ENVIRONMENT_DIRECTION = 4;
    /// Random dimension of positions on punctual lights, whose number stands above the lowest eight bits.
    PUNCTUAL_LIGHT_POSITION = 5;
    /// Random dimension of directions in a rough lobe.
    LOBE_DIRECTION = 11;
    /// Random dimension of Russian roulette.
    ROULETTE = 12;
    /// Random dimension of reflected branches.
    REFLECTED = 13;
    /// Random dimension of refracted branches.
    REFRACTED = 14;
    /// Random dimension of branches behind an alpha-blended layer.
    ALPHA_LAYER = 15;
}

#[cfg(test)]
mod tests {
    //! No number stands for two dimensions.

    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn no_two_dimensions_share_random_numbers() {
        let different: BTreeSet<u64> = ALL.iter().copied().collect();
        assert_eq!(different.len(), ALL.len());
        // The lights' numbers stand above these bits.
        assert!(ALL.iter().all(|dimension| *dimension < 1 << 8));
    }
}
