#!/bin/sh
# Runs clang-tidy on the library and the samples. The script takes several minutes and is not part of run.sh. It needs
# the folder build/, which `sh test/run.sh` makes.
#
#   sh test/tidy.sh [regular expression of files …]
set -eu
cd "$(dirname "$0")/.."
. samples/packages.sh
need_packages clang-tidy-16 || exit 1

[ $# -gt 0 ] || set -- "$PWD/(src|osal|oshw|samples)/"
run-clang-tidy-16 -p build -quiet -j "$(nproc)" "$@"
