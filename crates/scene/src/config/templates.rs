//! Starter scenes.

/// Starter scenes for `haff init` as (name, description, text), each one a complete scene.
pub fn templates() -> &'static [(&'static str, &'static str, &'static str)] {
    &[
        (
            "cooling",
            "a granular gas that cools by Haff's law (the default)",
            include_str!("../../../../configs/cooling.toml"),
        ),
        (
            "fluid",
            "an elastic hard-sphere fluid in equilibrium",
            include_str!("../../../../configs/fluid.toml"),
        ),
        ("mixture", "small and large elastic spheres", include_str!("../../../../configs/mixture.toml")),
        ("disks", "disks in two dimensions", include_str!("../../../../configs/disks.toml")),
        ("gravity_box", "grains bouncing over a floor", include_str!("../../../../configs/gravity_box.toml")),
        ("breakshot", "billiards: the break", include_str!("../../../../configs/breakshot.toml")),
        (
            "bouncing_ball",
            "one ball dropped on a floor",
            include_str!("../../../../configs/textbook/bouncing_ball.toml"),
        ),
    ]
}
