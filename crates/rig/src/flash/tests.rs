use super::*;

type Flash = Nor<4, 256>;

#[test]
fn a_byte_is_programmed_once_between_erases() {
    let mut flash = Flash::new(1_000);
    assert_eq!(flash.capacity(), 1_024);
    flash.write(8, &[1, 2, 3, 4]).unwrap();
    assert_eq!(flash.write(4, &[9; 8]), Err(Error::NotErased { offset: 8 }));
    assert_eq!(
        &flash.mapped()[4..14],
        &[255, 255, 255, 255, 1, 2, 3, 4, 255, 255]
    );
    flash.erase(0, 256).unwrap();
    flash.write(4, &[9; 8]).unwrap();
    let mut back = [0; 3];
    flash.read(11, &mut back).unwrap();
    assert_eq!(back, [9, 255, 255]);
    let expected = Counts {
        programs: 2,
        programmed_bytes: 12,
        erases: 1,
        reads: 1,
    };
    assert_eq!(flash.counts(), expected);
}

#[test]
fn ranges_off_the_unit_or_the_flash_are_refused() {
    let mut flash = Flash::new(512);
    assert_eq!(flash.write(2, &[0; 4]), Err(Error::NotAligned));
    assert_eq!(flash.write(0, &[0; 3]), Err(Error::NotAligned));
    assert_eq!(flash.erase(0, 100), Err(Error::NotAligned));
    assert_eq!(flash.erase(256, 768), Err(Error::OutOfBounds));
    assert_eq!(flash.erase(256, 0), Err(Error::OutOfBounds));
    assert_eq!(flash.write(u32::MAX - 3, &[0; 4]), Err(Error::OutOfBounds));
    assert_eq!(flash.read(510, &mut [0; 4]), Err(Error::OutOfBounds));
}

#[test]
fn mapped_bytes_lie_on_a_cache_line_wherever_the_value_moves() {
    for capacity in [256, 512, 4_096, 100_000] {
        let flash = Box::new(Flash::new(capacity));
        assert_eq!(flash.mapped().as_ptr().align_offset(64), 0);
        let moved = *flash;
        assert_eq!(moved.mapped().as_ptr().align_offset(64), 0);
    }
}

#[test]
fn a_cut_before_leaves_no_trace_and_a_cut_after_leaves_all() {
    for (phase, expected) in [(Phase::Before, [255; 4]), (Phase::After, [7; 4])] {
        let mut flash = Flash::new(256);
        flash.power().plan(Cut {
            after_operations: 1,
            phase,
            seed: 0,
        });
        flash.write(0, &[5; 4]).unwrap();
        assert_eq!(flash.write(4, &[7; 4]), Err(Error::PowerLost));
        assert_eq!(flash.write(8, &[7; 4]), Err(Error::PowerLost));
        assert_eq!(flash.read(0, &mut [0]), Err(Error::PowerLost));
        flash.power().restore();
        assert_eq!(&flash.mapped()[..4], &[5; 4]);
        assert_eq!(&flash.mapped()[4..8], &expected);
        assert_eq!(&flash.mapped()[8..12], &[255; 4]);
    }
}

#[test]
fn a_torn_program_keeps_a_prefix_and_only_lets_bits_fall() {
    let new: Vec<u8> = (0..64).collect();
    let mut torn_units = 0;
    for seed in 0..200 {
        let mut flash = Flash::new(256);
        flash.power().plan(Cut {
            after_operations: 0,
            phase: Phase::Inside,
            seed,
        });
        assert_eq!(flash.write(0, &new), Err(Error::PowerLost));
        let cells = &flash.mapped()[..64];
        let whole = cells
            .chunks(4)
            .zip(new.chunks(4))
            .take_while(|(a, b)| a == b)
            .count();
        for (i, (cell, byte)) in cells.iter().zip(&new).enumerate() {
            assert_eq!(cell & byte, *byte, "a bit of the new byte {i} is missing");
            assert!(
                i < (whole + 1) * 4 || *cell == 255,
                "byte {i} lies behind the tear"
            );
        }
        torn_units += usize::from(cells.get(whole * 4).is_some_and(|c| *c != 255));
    }
    assert!(torn_units > 50, "{torn_units}");
}

#[test]
fn a_torn_erase_only_lets_bits_rise_and_differs_by_seed() {
    let mut contents = std::collections::BTreeSet::new();
    for seed in 0..50 {
        let mut flash = Flash::new(256);
        flash.write(0, &[0x5A; 256]).unwrap();
        flash.power().plan(Cut {
            after_operations: 0,
            phase: Phase::Inside,
            seed,
        });
        assert_eq!(flash.erase(0, 256), Err(Error::PowerLost));
        assert!(flash.mapped().iter().all(|c| c & 0x5A == 0x5A));
        contents.insert(flash.mapped().to_vec());
    }
    assert!(contents.len() > 40);
}

#[test]
fn one_supply_takes_all_its_flashes() {
    let power = Power::new();
    let (mut a, mut b) = (
        Flash::with_power(256, &power),
        Flash::with_power(256, &power),
    );
    power.plan(Cut {
        after_operations: 1,
        phase: Phase::Before,
        seed: 0,
    });
    a.erase(0, 256).unwrap();
    assert_eq!(b.erase(0, 256), Err(Error::PowerLost));
    assert_eq!(a.write(0, &[0; 4]), Err(Error::PowerLost));
    assert_eq!(power.operations(), 1);
}

#[test]
fn unit_by_unit_a_cut_stands_between_any_two_units() {
    for after_operations in 0..16 {
        let mut flash = Flash::new(256).by_unit();
        flash.power().plan(Cut {
            after_operations,
            phase: Phase::Before,
            seed: 0,
        });
        assert_eq!(flash.write(0, &[7; 64]), Err(Error::PowerLost));
        let done = after_operations as usize * 4;
        assert!(flash.mapped()[..done].iter().all(|cell| *cell == 7));
        assert!(flash.mapped()[done..].iter().all(|cell| *cell == 255));
    }
}
