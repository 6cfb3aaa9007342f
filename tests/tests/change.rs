//! A shelf that is moved overnight: the raster and the vector map follow it.

use mapfold_map::raster::SliceConfig;
use mapfold_tests::change::follow;

#[test]
fn a_shelf_that_has_moved_is_gone_and_there_and_the_hall_stays() {
    let followed = follow(3, 45, SliceConfig::STANDARD.length_s, 5).unwrap();
    assert!(followed.gone_after.is_some_and(|looks| looks <= 30), "{followed:?}");
    assert!(followed.there_after.is_some(), "{followed:?}");
    assert!(followed.walls_left_m < 0.2, "{followed:?}");
    assert!(followed.hall_kept > 0.97, "{followed:?}");
}

#[test]
fn one_sum_of_all_days_does_not_follow() {
    let followed = follow(3, 45, u32::MAX, 5).unwrap();
    assert_eq!((followed.gone_after, followed.there_after), (None, None), "{followed:?}");
}
