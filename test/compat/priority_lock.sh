#!/bin/sh
# Builds priority_lock.cpp with ThreadSanitizer, and executes it: priority_lock.sh COMPILER SOURCE_FOLDER PROGRAM.
# Ends with 77 when the compiler or the machine has no ThreadSanitizer.
set -eu
compiler=$1 source=$2 program=$3
echo 'int main() {}' > "$program.cpp"
"$compiler" -fsanitize=thread "$program.cpp" -o "$program" -pthread && "$program" || exit 77
"$compiler" -std=c++20 -fsanitize=thread -g -O1 -I"$source/src" -I"$source/include" "$source/src/compat/soem/priority_lock.cpp" \
  "$source/test/compat/priority_lock.cpp" -o "$program" -pthread
"$program"
