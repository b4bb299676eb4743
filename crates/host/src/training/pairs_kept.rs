//! The reference pairs in a model's file: what a map was taught with is judged with it.

use trainer::data::Pairs;
use trainer::model::{Metadata, Model};

/// The key of the metadata: pairs between semicolons, an input's values, a bar, a target's values, in the domains' own units.
pub const KEY: &str = "reference_pairs";
/// A file with more of them carries none: the header of a model is no place for a data set.
pub const MOST: usize = 64;

/// Writes the pairs (in the domains' own units) into what is known about a model.
pub fn keep(pairs: &Pairs, metadata: &mut Metadata) {
    if pairs.inputs.rows == 0 || pairs.inputs.rows > MOST {
        return;
    }
    let words = |row: &[f32]| row.iter().map(f32::to_string).collect::<Vec<_>>().join(" ");
    let rows = pairs.inputs.iter_rows().zip(pairs.targets.iter_rows());
    let text: Vec<String> = rows
        .map(|(q, x)| format!("{}|{}", words(q), words(x)))
        .collect();
    metadata.insert(KEY.to_owned(), text.join(";"));
}

/// The pairs that a model carries, in its domains' units; `None` where it has none, or what stands there is not of its shape.
pub fn reference_pairs(model: &Model) -> Option<Pairs> {
    let mut pairs = Pairs::default();
    let numbers = |text: &str, count: usize| -> Option<Vec<f32>> {
        let values: Result<Vec<f32>, _> = text.split(' ').map(str::parse).collect();
        let is_usable =
            |values: &Vec<f32>| values.len() == count && values.iter().all(|v| v.is_finite());
        values.ok().filter(is_usable)
    };
    let [inputs, _, outputs] = model.shape();
    for pair in model.metadata.get(KEY)?.split(';').take(MOST) {
        let (q, x) = pair.split_once('|')?;
        pairs.inputs.push(&numbers(q, inputs)?);
        pairs.targets.push(&numbers(x, outputs)?);
    }
    Some(pairs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use trainer::data::Matrix;
    use trainer::model::Normalisation;
    use trainer::network::Network;

    #[test]
    fn pairs_come_back_as_they_were_and_those_of_another_shape_do_not() {
        let pairs = Pairs {
            inputs: Matrix::from_rows(&[[0.1, -2.5], [1.0 / 3.0, 4.0]]),
            targets: Matrix::from_rows(&[[255.0], [0.25]]),
        };
        let mut model = Model {
            f: Network::zeros(2, 3, 1),
            g: Network::zeros(1, 3, 2),
            q: Normalisation::identity(2),
            x: Normalisation::identity(1),
            metadata: Metadata::default(),
        };
        assert_eq!(reference_pairs(&model), None);
        keep(&pairs, &mut model.metadata);
        assert_eq!(reference_pairs(&model), Some(pairs));
        for wrong in ["", "1 2", "1|2", "1 x|3", "1 nan|3", "1 2|3 4"] {
            model.metadata.insert(KEY.to_owned(), wrong.to_owned());
            assert_eq!(reference_pairs(&model), None, "{wrong}");
        }
    }
}
