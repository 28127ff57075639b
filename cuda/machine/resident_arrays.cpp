#include "cuda/machine/resident_arrays.hpp"

#include <algorithm>
#include <cstring>

#include "cuda/api/mover.hpp"
#include "stiction/error.hpp"

namespace stiction::cuda {

bool ResidentArrays::Resident::is_changed() const {
  return !seen.empty() && std::memcmp(host, seen.data(), bytes) != 0;
}

/// The device's copy is ahead from now on.
void ResidentArrays::Resident::leave() {
  is_current = is_open = false;
}

ResidentArrays::Resident* ResidentArrays::find(const void* address) {
  const auto* const byte = static_cast<const std::byte*>(address);
  for (Resident& one : arrays_)
    if (byte >= one.host && byte < one.host + one.bytes) return &one;
  return nullptr;
}

void ResidentArrays::queue_all_to_device(StreamHandle stream) {
  for (const Resident& one : arrays_) api_.copy(one.there, one.host, one.bytes, CopyKind::to_device, stream);
}

void ResidentArrays::open(const void* array, StreamHandle stream) {
  Resident* const one = find(array);
  if (one == nullptr) return;
  if (one->is_open && one->is_current && (!is_shared_ || one->is_changed())) return;
  if (is_shared_ || !one->is_current)
    queue_all(api_, stream, [&] {
      api_.copy(one->host, one->there, one->bytes, CopyKind::to_host, stream);
      api_.synchronize(stream);
    });
  one->is_current = one->is_open = true;
  one->seen.assign(one->host, one->host + one->bytes);
}

bool ResidentArrays::has_changes() const {
  return std::any_of(arrays_.begin(), arrays_.end(), [](const Resident& one) { return one.is_changed(); });
}

void ResidentArrays::give_back(StreamHandle stream) {
  std::vector<Resident*> changed;
  for (Resident& one : arrays_)
    if (one.is_changed()) changed.push_back(&one);
  for (const Resident* one : changed)
    if (!one->is_open)
      throw Error(ErrorCode::invalid_argument, one->name +
                                                   " was changed through a span that is no longer valid: ask for " +
                                                   one->name + " again after each call that writes it");
  if (changed.empty()) return;
  queue_all(api_, stream, [&] {
    for (const Resident* one : changed) api_.copy(one->there, one->host, one->bytes, CopyKind::to_device, stream);
    api_.synchronize(stream);
  });
  for (Resident* one : changed) one->seen.assign(one->host, one->host + one->bytes);
}

void ResidentArrays::overwrite(const void* array, const void* from, std::size_t bytes, StreamHandle stream) {
  Resident* const one = find(array);
  if (one == nullptr || bytes == 0) return;
  api_.copy(one->there, from, bytes, CopyKind::on_device, stream);
  one->leave();
}

void ResidentArrays::leave(const void* array) {
  if (Resident* const one = find(array)) one->leave();
}

void ResidentArrays::note_work() {
  for (Resident& one : arrays_)
    if (one.is_written) one.leave();
}

}  // namespace stiction::cuda
