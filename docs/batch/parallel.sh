#!/usr/bin/env bash
# Calibrate every camera and undistort its photos with GNU parallel: parallel.sh target.yaml CAMERA...
#
# CAMERA is a folder with the folders board/ and photos/. What is there already is kept, so the
# same command goes on where a run stopped. The exit code is not 0 when something failed; the
# columns Exitval and Command of jobs.log say what.
set -euo pipefail
export target=$1
shift

calibrate() { # CAMERA
  [ -e "$1/calibration/camera.yaml" ] ||
    cubicfish calibrate "$1/board" --target "$target" -o "$1/calibration" --jobs 1 --quiet
}
undistort() { # PHOTO... of $camera
  cubicfish undistort "$@" "$camera/flat/" --model "$camera/calibration/camera.yaml" \
    --hfov 90 --skip-existing --jobs 1
}
export -f calibrate undistort
export SHELL=$BASH

status=0
parallel --joblog jobs.log calibrate {} ::: "$@" || status=1
for camera in "$@"; do
  [ -e "$camera/calibration/camera.yaml" ] || continue # it failed
  export camera
  find "$camera/photos" -maxdepth 1 -type f ! -name '.*' -print0 | sort -z |
    parallel -0 -X --max-args 50 --joblog +jobs.log undistort || status=1
done
exit "$status"
