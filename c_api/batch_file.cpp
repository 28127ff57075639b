#include <optional>

#include "c_api/handles.hpp"
#include "c_api/judge.hpp"
#include "c_api/structs.hpp"
#include "c_api/views.hpp"
#include "stiction/io.hpp"

namespace stiction::c {

namespace {

/// A file's batch, in f64 as files are, and in f32 once that is requested.
struct ReadBatch {
  io::Recording recording;
  std::optional<ContactBatch<float>> rounded;
};

auto& batches() {
  static auto& table =
      *new HandleTable<::stiction_batch, ReadBatch>({"batch", "stiction_batch", "stiction_batch_read"});
  return table;
}

}  // namespace

}  // namespace stiction::c

namespace c = stiction::c;

stiction_code stiction_batch_read(const char* path, stiction_batch** batch) {
  return c::guarded([&] {
    c::need(path, "path", "give the file's name");
    c::need(batch, "batch", "give it room for a handle");
    *batch =
        c::batches().add(std::make_shared<c::ReadBatch>(c::ReadBatch{stiction::io::read_batch(path), std::nullopt}));
  });
}

stiction_code stiction_batch_destroy(stiction_batch* batch) {
  return c::guarded([&] { c::batches().remove(batch); });
}

stiction_code stiction_batch_get_view(stiction_batch* batch, int32_t precision, stiction_batch_view* view) {
  return c::guarded([&] {
    const auto object = c::batches().get(batch);
    static_cast<void>(c::read_struct(view, "view"));
    if (c::precision_of("precision", precision) == stiction::Precision::f64) {
      c::write_struct(view, c::to_c(object->recording.batch.view()), view->size);
      return;
    }
    if (!object->rounded.has_value()) object->rounded = stiction::convert<float>(object->recording.batch);
    c::write_struct(view, c::to_c(object->rounded->view()), view->size);
  });
}

stiction_code stiction_batch_get_cone_ids(stiction_batch* batch, const uint64_t** cone_id) {
  return c::guarded([&] {
    const auto object = c::batches().get(batch);
    c::need(cone_id, "cone_id", "give it room for a pointer");
    const auto& ids = object->recording.cone_id;
    *cone_id = ids.empty() ? nullptr : ids.data();
  });
}

stiction_code stiction_batch_write(const char* path, const stiction_batch_view* batch, const char* source) {
  return c::guarded([&] {
    c::need(path, "path", "give the file's name");
    const stiction_batch_view given = c::read_struct(batch, "batch");
    stiction::io::Recording recording;
    if (source != nullptr) recording.source = source;
    c::with_real(c::precision_of("batch.precision", given.precision), [&](auto zero) {
      const auto view = c::to_cpp<decltype(zero)>(given);
      c::need_host(view.space);
      const stiction::Solver packer(stiction::Device::cpu(), stiction::SolverOptions{});
      recording.batch = stiction::convert<double>(packer.to_host(view));
    });
    stiction::io::write_batch(path, recording);
  });
}
