use haff_testing::Random;

use super::*;

/// One, two and many bins along an axis, some of them with more than one block, and bins onto which a
/// large box with a cluster is folded. Each reference position moves before it is searched from.
#[test]
fn each_neighbor_is_found_once() {
    let mut random = Random(1);
    for (edges, tilted) in [
        ([8.0, 8.0, 8.0], 0.0),
        ([8.0, 8.0, 8.0], 1.0),
        ([4.1, 12.0, 6.5], 0.0),
        ([5.0, 9.0, 0.0], -2.0),
        ([30.0, 6.0, 5.0], 2.0),
        ([640.0, 5000.0, 320.0], 0.0),
    ] {
        let unit = edges.map(|edge| if edge > 0.0 { (edge / 2.0_f64.powi(32)) as f32 } else { 1.0 });
        let reach = 2.0_f32;
        let tilt = 0.3 * tilted;
        let layout = Layout { edges, unit, tilt, skin: 0.0, spacing: 1.0 };
        let mut bins = Bins::new(&layout, f64::from(reach), 1.0, 600);
        let tilt = tilt as f32;
        let mut coordinate = |axis: usize| {
            // Clusters between 10 and 20 wide.
            let empty = (edges[axis] / 10.0).max(1.0).log2() as u32;
            if edges[axis] > 0.0 { (random.bits() as i32) >> empty } else { 0 }
        };
        let mut positions: Vec<[i32; 3]> = (0..600).map(|_| [0, 1, 2].map(&mut coordinate)).collect();
        for (i, x) in positions.iter().enumerate() {
            bins.insert::<false>(i as u32, *x);
        }
        let mut total = 0;
        for i in 0..positions.len() {
            bins.remove::<false>(i as u32, positions[i]);
            positions[i] = [0, 1, 2].map(&mut coordinate);
            bins.insert::<false>(i as u32, positions[i]);
            let x = positions[i];
            let mut expected: Vec<u32> = (0..600)
                .filter(|&j| distance2::<true>(positions[j as usize], x, unit, tilt) < reach * reach)
                .collect();
            expected.sort_unstable();
            let mut found = Vec::new();
            let count = bins.near::<false, true>(x, reach * reach, &mut found);
            found.truncate(count);
            found.sort_unstable();
            assert_eq!(found, expected, "{edges:?}, {i}");
            for reach in [0.5 * reach, 3.7 * reach] {
                let near = |&j: &u32| distance2::<true>(positions[j as usize], x, unit, tilt) < reach * reach;
                let expected: Vec<u32> = (0..600).filter(near).collect();
                let mut found = Vec::new();
                bins.add_near(x, reach, &mut found);
                found.sort_unstable();
                assert_eq!(found, expected, "{edges:?}, {i}, {reach}");
            }
            #[cfg(target_arch = "x86_64")]
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                let mut found = Vec::new();
                // SAFETY: the features have just been detected.
                let count = unsafe { near_avx2(&bins, x, reach * reach, &mut found) };
                found.truncate(count);
                found.sort_unstable();
                assert_eq!(found, expected, "{edges:?}, {i}, vectors");
            }
            total += expected.len();
        }
        assert!(total > 3 * 600, "{edges:?}: {total}");
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn near_avx2(bins: &Bins, x: [i32; 3], reach2: f32, found: &mut Vec<u32>) -> usize {
    bins.near::<true, true>(x, reach2, found)
}
