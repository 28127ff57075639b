# Cross-compiles for Linux on 64-bit Arm by Debian's g++-aarch64-linux-gnu; what is built runs under qemu-user
# (scripts/aarch64.sh). Packages are searched for in the cross compiler's root and in STICTION_TARGET_ROOT, never on the
# machine that compiles.
#
#   cmake --toolchain cmake/toolchain-aarch64.cmake -DSTICTION_TARGET_ROOT=FOLDER ...
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64 -L /usr/aarch64-linux-gnu)

set(STICTION_TARGET_ROOT "" CACHE PATH "Folder with packages for the target, GoogleTest for example")
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES STICTION_TARGET_ROOT)
set(CMAKE_FIND_ROOT_PATH /usr/aarch64-linux-gnu ${STICTION_TARGET_ROOT})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
