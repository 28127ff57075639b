// All that is in this library comes from others (tested_library.cmake); CMake wants a library to have a source.
