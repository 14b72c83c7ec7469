//! Deserialization of values that may be written in several forms.

use std::fmt;

use serde::Deserialize;
use serde::de::{
    self, Deserializer, MapAccess, SeqAccess, Visitor,
    value::{MapAccessDeserializer, SeqAccessDeserializer},
};

use super::keys::{
    BinsConfig, EventColumnsConfig, EventsConfig, FileConfig, FollowedConfig, FollowedSpeciesConfig,
    GrownConfig, OutputFileConfig, PackingConfig, PositionsConfig, RadiusConfig, RadiusDistribution,
    RestitutionConfig, RestitutionModelConfig, ScheduleConfig, ScheduleTableConfig, SizeTableConfig,
    SizesConfig, SpeciesChoice, WallTimeConfig,
};
use crate::source::read::keys_of;

/// Deserializes one of several types by the type of the value, so that an error inside a table is located
/// there. serde's `untagged` tries all variants and can only report that none fits.
macro_rules! by_shape {
    ($type:ident, $expecting:literal $(, number $number:expr)? $(, text $text:expr)? $(, boolean $boolean:expr)?
     $(, list $list:expr)? $(, table $table:expr, of $keys:ty)?) => {
        impl<'de> Deserialize<'de> for $type {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                struct Shapes;
                impl<'de> Visitor<'de> for Shapes {
                    type Value = $type;
                    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                        f.write_str($expecting)
                    }
                    $(fn visit_f64<E: de::Error>(self, value: f64) -> Result<$type, E> {
                        Ok($number(value))
                    }
                    fn visit_i64<E: de::Error>(self, value: i64) -> Result<$type, E> {
                        Ok($number(value as f64))
                    })?
                    $(fn visit_str<E: de::Error>(self, value: &str) -> Result<$type, E> {
                        $text(value)
                    })?
                    $(fn visit_bool<E: de::Error>(self, value: bool) -> Result<$type, E> {
                        $boolean(value)
                    })?
                    $(fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<$type, A::Error> {
                        Ok($list(Deserialize::deserialize(SeqAccessDeserializer::new(list))?))
                    })?
                    $(fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<$type, A::Error> {
                        Ok($table(Deserialize::deserialize(MapAccessDeserializer::new(map))?))
                    })?
                }
                // As a structure if one of the types is one, which passes its keys to the deserializer.
                $(return deserializer.deserialize_struct(stringify!($type), keys_of::<$keys>(), Shapes);)?
                #[allow(unreachable_code)]
                deserializer.deserialize_any(Shapes)
            }
        }
    };
}

by_shape!(
    RadiusConfig, "a number, { uniform = [a, b] } or { normal = [mean, sd] }",
    number RadiusConfig::Fixed,
    table RadiusConfig::Distribution, of RadiusDistribution
);
by_shape!(
    SizeTableConfig, "a path or { radii = […], weights = […] }",
    text |text: &str| Ok(SizeTableConfig::File(text.to_owned())),
    table SizeTableConfig::Values, of SizesConfig
);
by_shape!(
    PositionsConfig, "\"lattice\", \"fcc\", \"hexagonal\", \"random\", { packing = … } or { file = \"…\" }",
    text |text: &str| {
        PackingConfig::deserialize(de::value::StrDeserializer::<E>::new(text)).map(PositionsConfig::Packing)
    },
    table positions_table, of FileConfig
);
/// Positions as a table: of a file, or of a packing.
fn positions_table(config: FileConfig) -> PositionsConfig {
    match config {
        FileConfig { file: None, index: None, scale_to: None, packing: packing @ Some(_) } => {
            PositionsConfig::Grown(GrownConfig { packing })
        }
        _ => PositionsConfig::File(config),
    }
}

by_shape!(
    BinsConfig, "a number, or a list with one number for each axis",
    number BinsConfig::Each,
    list BinsConfig::PerAxis
);
by_shape!(
    FollowedConfig, "true, false or { species = … }",
    boolean |value: bool| Ok(FollowedConfig::All(value)),
    table FollowedConfig::Species, of FollowedSpeciesConfig
);
by_shape!(
    SpeciesChoice, "\"each\", or a list with names of species",
    text |text: &str| Ok(SpeciesChoice::Each(text.to_owned())),
    list SpeciesChoice::Names
);
by_shape!(
    RestitutionConfig, "a number in [0, 1] or a table { model = … }",
    number RestitutionConfig::Constant,
    table |model| RestitutionConfig::Model(Box::new(model)), of RestitutionModelConfig
);
by_shape!(
    WallTimeConfig, "a duration such as \"2h\" or a number of seconds",
    number WallTimeConfig::Seconds,
    text |text: &str| Ok(WallTimeConfig::Text(text.to_owned()))
);
by_shape!(
    OutputFileConfig, "a path or false",
    text |text: &str| Ok(OutputFileConfig::Path(text.to_owned())),
    boolean |value: bool| if value {
        Err(E::invalid_value(de::Unexpected::Bool(true), &"a path or false"))
    } else {
        Ok(OutputFileConfig::Off(false))
    }
);
by_shape!(
    EventsConfig, "true, false or { columns = […] }",
    boolean |value: bool| Ok(EventsConfig::All(value)),
    table EventsConfig::Some, of EventColumnsConfig
);
by_shape!(
    ScheduleConfig, "a number, { log = [first, factor] }, { collisions_per_particle = … } or false",
    number ScheduleConfig::Every,
    boolean |value: bool| if value {
        Err(E::invalid_value(
            de::Unexpected::Bool(true),
            &"a number, { log = [first, factor] }, { collisions_per_particle = … } or false",
        ))
    } else {
        Ok(ScheduleConfig::Off(false))
    },
    table ScheduleConfig::Table, of ScheduleTableConfig
);
