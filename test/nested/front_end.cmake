# Included by project() where only the warnings of the compiler's front end count: nothing is translated, and the object
# files are empty.
# With -Xclang -o a precompiled header is written: its flags replace -fsyntax-only. For other sources nothing is written.
set(CMAKE_CXX_COMPILE_OBJECT "<CMAKE_CXX_COMPILER> <DEFINES> <INCLUDES> <FLAGS> -fsyntax-only -Xclang -o -Xclang <OBJECT> <SOURCE>"
                             "<CMAKE_COMMAND> -E touch <OBJECT>")
set(CMAKE_CXX_ARCHIVE_CREATE "<CMAKE_COMMAND> -E touch <TARGET>")
set(CMAKE_CXX_ARCHIVE_APPEND "<CMAKE_COMMAND> -E touch <TARGET>")
set(CMAKE_CXX_ARCHIVE_FINISH "")
