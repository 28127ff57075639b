# Finds nvcc if STICTION_ENABLE_CUDA allows it and sets STICTION_HAS_CUDA.
set(STICTION_HAS_CUDA OFF)
if(NOT STICTION_ENABLE_CUDA STREQUAL "OFF")
  include(CheckLanguage)
  check_language(CUDA)
  if(CMAKE_CUDA_COMPILER)
    if(NOT DEFINED CMAKE_CUDA_ARCHITECTURES)
      # Machine code for H100/H200, PTX for A100 (which its driver translates once) and for what comes after. Machine
      # code for an architecture more costs as much time as the rest of the build.
      set(CMAKE_CUDA_ARCHITECTURES 80-virtual 90-real 90-virtual)
      # Methods that factorise, of which there are many: one PTX that every driver translates.
      set(STICTION_CUDA_DIRECT_ARCHITECTURES 80-virtual)
    else()
      set(STICTION_CUDA_DIRECT_ARCHITECTURES ${CMAKE_CUDA_ARCHITECTURES})
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
