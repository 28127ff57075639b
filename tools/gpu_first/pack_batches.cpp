// pack_batches FOLDER BATCH.h5 ...: writes J and M of the first environments of each file, in single precision, to
// FOLDER/BATCH.batch, which gpu_first reads without HDF5. Missing files are left out, and listed.

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <numeric>
#include <vector>

#include "stiction/error.hpp"
#include "stiction/io.hpp"
#include "tools/gpu_first/recorded.hpp"

namespace {

constexpr stiction::Offset kMostEnvs = 256;

int run(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "pack_batches: give a folder and contact batches\n");
    return 2;
  }
  std::filesystem::create_directories(argv[1]);
  for (int i = 2; i < argc; ++i) {
    const std::filesystem::path path = argv[i];
    if (!std::filesystem::exists(path)) {
      std::printf("%s is not here, and left out\n", argv[i]);
      continue;
    }
    const stiction::io::Recording recording = stiction::io::read_batch(path);
    std::vector<stiction::Offset> order(static_cast<std::size_t>(std::min(kMostEnvs, recording.batch.env_count())));
    std::iota(order.begin(), order.end(), stiction::Offset{0});
    stiction::gpu_first::write_recorded(std::string(argv[1]) + "/" + path.stem().string() + ".batch",
                                        stiction::io::jacobian_batch<float>(recording, order));
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "pack_batches: %s\n", error.what());
    return 2;
  }
}
