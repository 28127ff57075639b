# Finds nvcc if STICTION_ENABLE_CUDA asks for it and sets STICTION_HAS_CUDA. AUTO asks where a GPU is seen: compiling for
# one takes longer than all else together, and a machine without can use none of it.
set(STICTION_HAS_CUDA OFF)
find_program(STICTION_NVIDIA_SMI nvidia-smi)
mark_as_advanced(STICTION_NVIDIA_SMI)
set(_gpu_architectures)
if(STICTION_NVIDIA_SMI)
  execute_process(COMMAND ${STICTION_NVIDIA_SMI} --query-gpu=compute_cap --format=csv,noheader
                  OUTPUT_VARIABLE _gpu_capabilities OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE _no_gpu ERROR_QUIET)
  if(_no_gpu EQUAL 0 AND _gpu_capabilities MATCHES "^[0-9]+\\.[0-9]")
    string(REPLACE "\n" ";" _gpu_architectures "${_gpu_capabilities}")
    list(TRANSFORM _gpu_architectures STRIP)
    list(TRANSFORM _gpu_architectures REPLACE "\\." "")
    list(TRANSFORM _gpu_architectures APPEND "-real")
    list(REMOVE_DUPLICATES _gpu_architectures)
  endif()
endif()
if(STICTION_ENABLE_CUDA STREQUAL "ON" OR (STICTION_ENABLE_CUDA STREQUAL "AUTO" AND _gpu_architectures))
  include(CheckLanguage)
  check_language(CUDA)
  if(CMAKE_CUDA_COMPILER)
    # Where a GPU is seen: machine code for it, with all optimisations. Elsewhere one PTX, for A100 and whatever comes after. From that same PTX comes machine code for H100/H200, but only
    # of what all solvers share: the solvers' own would take most of the build, an hour on some machines. The driver
    # translates them at first use, and keeps the result. Where solves are to start at once and run as fast as they can,
    # name the architectures: -DCMAKE_CUDA_ARCHITECTURES=90-real.
    if(DEFINED CMAKE_CUDA_ARCHITECTURES)
      set(STICTION_CUDA_BY_DEFAULT OFF)
    elseif(_gpu_architectures)
      set(STICTION_CUDA_BY_DEFAULT OFF)
      set(CMAKE_CUDA_ARCHITECTURES ${_gpu_architectures})
    else()
      set(STICTION_CUDA_BY_DEFAULT ON)
      set(CMAKE_CUDA_ARCHITECTURES 80-virtual)
    endif()
    enable_language(CUDA)
    # CMake before 3.25.2 does not know that nvcc 12 and later speak C++20 and would silently use C++17.
    if(CMAKE_CUDA_COMPILER_ID STREQUAL "NVIDIA" AND CMAKE_CUDA_COMPILER_VERSION VERSION_GREATER_EQUAL 12.0
       AND NOT DEFINED CMAKE_CUDA20_STANDARD_COMPILE_OPTION)
      set(CMAKE_CUDA20_STANDARD_COMPILE_OPTION "-std=c++20")
      set(CMAKE_CUDA20_EXTENSION_COMPILE_OPTION "-std=c++20")
      list(APPEND CMAKE_CUDA_COMPILE_FEATURES cuda_std_20)
    endif()
    find_package(CUDAToolkit 12.0 REQUIRED)
    set(STICTION_HAS_CUDA ON)
  elseif(STICTION_ENABLE_CUDA STREQUAL "ON")
    message(FATAL_ERROR "STICTION_ENABLE_CUDA=ON but no CUDA compiler was found: set CUDACXX to nvcc (scripts/get_cuda.sh "
                        "fetches one), or pass -DSTICTION_ENABLE_CUDA=OFF")
  endif()
endif()
