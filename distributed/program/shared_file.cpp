#include "distributed/program/shared_file.hpp"

#include <fcntl.h>
#include <hdf5.h>
#include <mpi.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "core/io/checkpoint_layout.hpp"
#include "distributed/transport/letters.hpp"
#include "stiction/error.hpp"

namespace stiction::distributed {

namespace {

/// For HDF5's own bytes: headers and attributes.
constexpr std::uint64_t kHeaderBytes = std::uint64_t{1} << 16;

/// Closes an identifier of HDF5 that no other rank waits for.
class Local {
 public:
  Local(hid_t id, herr_t (*closer)(hid_t)) : id_(id), close_(closer) {}
  ~Local() {
    if (id_ >= 0) close_(id_);
  }
  Local(const Local&) = delete;
  Local& operator=(const Local&) = delete;
  [[nodiscard]] hid_t get() const { return id_; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

class ParallelFile final : public SharedFile {
 public:
  ParallelFile(Transport& transport, const std::filesystem::path& path)
      : transport_(transport), path_(path), temporary_(path) {
    static std::uint64_t serial = 0;
    temporary_ += "." + std::to_string(gather(transport, std::int64_t{getpid()}).front()) + "." +
                  std::to_string(serial++) + ".part";
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    const Local create(H5Pcreate(H5P_FILE_CREATE), H5Pclose), access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    H5Pset_obj_track_times(create.get(), false);
    H5Pset_fapl_mpio(access.get(), MPI_COMM_WORLD, MPI_INFO_NULL);
    file_ = H5Fcreate(temporary_.c_str(), H5F_ACC_EXCL, create.get(), access.get());
    if (file_ < 0) fail("cannot be created by all ranks: is the folder there, writable, and one that all see?");
  }
  /// Not closed where it is not complete: HDF5 would wait for the others, or write where there is no room.
  ~ParallelFile() override {
    std::error_code ignored;
    if (!is_in_place_) std::filesystem::remove(temporary_, ignored);
  }
  ParallelFile(const ParallelFile&) = delete;
  ParallelFile& operator=(const ParallelFile&) = delete;

  void reserve(std::uint64_t bytes) const {
    if (transport_.rank() == 0) allocate(bytes);
    static_cast<void>(gather(transport_, char{0}));  // there is room
  }
  void attribute(const std::string& name, const std::string& value) override {
    const Local type(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_size(type.get(), value.size() + 1);
    H5Tset_cset(type.get(), H5T_CSET_UTF8);
    put(name, type.get(), type.get(), value.c_str());
  }
  void attribute(const std::string& name, std::int64_t value) override {
    put(name, H5T_STD_I64LE, H5T_NATIVE_INT64, &value);
  }
  void array(const std::string& name, std::span<const double> own, const Slab& slab) override {
    write(name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, own.data(), slab);
  }
  void array(const std::string& name, std::span<const float> own, const Slab& slab) override {
    write(name, H5T_IEEE_F32LE, H5T_NATIVE_FLOAT, own.data(), slab);
  }
  void array(const std::string& name, std::span<const std::int64_t> own, const Slab& slab) override {
    write(name, H5T_STD_I64LE, H5T_NATIVE_INT64, own.data(), slab);
  }
  void array(const std::string& name, std::span<const std::uint64_t> own, const Slab& slab) override {
    write(name, H5T_STD_U64LE, H5T_NATIVE_UINT64, own.data(), slab);
  }

  void commit() override {
    if (H5Fclose(std::exchange(file_, -1)) < 0) fail("cannot be completed");
    static_cast<void>(gather(transport_, char{0}));  // all have closed it
    if (transport_.rank() == 0) io::put_checkpoint_in_place(temporary_, path_);
    static_cast<void>(gather(transport_, char{0}));  // the next one waits until this one is there
    is_in_place_ = true;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { throw Error(ErrorCode::io, path_.string() + ": " + what); }
  void allocate(std::uint64_t bytes) const {
    const int disk = open(temporary_.c_str(), O_WRONLY | O_CLOEXEC);
    const int reason = disk < 0 ? errno : posix_fallocate(disk, 0, static_cast<off_t>(bytes));
    if (disk >= 0) close(disk);
    if (reason != 0) fail(std::string("cannot be written: ") + std::strerror(reason));
  }
  void put(const std::string& name, hid_t file_type, hid_t memory_type, const void* value) const {
    const Local space(H5Screate(H5S_SCALAR), H5Sclose);
    const Local made(H5Acreate2(file_, name.c_str(), file_type, space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    if (made.get() < 0 || H5Awrite(made.get(), memory_type, value) < 0)
      fail("attribute '" + name + "' cannot be written");
  }
  void write(const std::string& name, hid_t file_type, hid_t memory_type, const void* own, const Slab& slab) const {
    const hsize_t total = slab.total, start = slab.start, stride = slab.stride, count = slab.count, block = slab.block;
    const hsize_t numbers = count * block;
    const Local space(H5Screate_simple(1, &total, nullptr), H5Sclose), create(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    H5Pset_obj_track_times(create.get(), false);
    H5Pset_fill_time(create.get(), H5D_FILL_TIME_NEVER);  // every number is some rank's
    const Local made(H5Dcreate2(file_, name.c_str(), file_type, space.get(), H5P_DEFAULT, create.get(), H5P_DEFAULT),
                     H5Dclose);
    bool is_written = made.get() >= 0;
    if (is_written && numbers > 0) {
      const Local memory(H5Screate_simple(1, &numbers, nullptr), H5Sclose);
      is_written = H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, &start, &stride, &count, &block) >= 0 &&
                   H5Dwrite(made.get(), memory_type, memory.get(), space.get(), H5P_DEFAULT, own) >= 0;
    }
    if (!is_written) fail("dataset '" + name + "' cannot be written");
  }

  Transport& transport_;
  std::filesystem::path path_, temporary_;
  hid_t file_ = -1;
  bool is_in_place_ = false;
};

}  // namespace

bool has_shared_files() {
  return true;
}

std::unique_ptr<SharedFile> make_shared_file(Transport& transport, const std::filesystem::path& path,
                                             std::uint64_t bytes) {
  auto file = std::make_unique<ParallelFile>(transport, path);
  file->reserve(bytes + kHeaderBytes);
  return file;
}

}  // namespace stiction::distributed
