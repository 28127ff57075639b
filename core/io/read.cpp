#include "core/base/fp_env.hpp"
#include "core/io/readers.hpp"
#include "stiction/error.hpp"

namespace stiction::io {

FileKind kind_of(const InputFile& file) {
  if (file.has("fclib_local")) return FileKind::fclib_local;
  if (file.has("fclib_global")) return FileKind::fclib_global;
  if (file.has("fclib_global_rolling") || file.has("fclib_local_rolling")) return FileKind::fclib_rolling;
  const auto format = file.text_attribute("format");
  if (!format) file.refuse("neither a contact batch (attribute 'format' is missing) nor an FCLIB problem");
  if (*format != "contact-batch") file.refuse("attribute 'format' is '" + *format + "', expected 'contact-batch'");
  return FileKind::contact_batch;
}

Recording read_any(const InputFile& file) {
  switch (kind_of(file)) {
    case FileKind::contact_batch:
      return read_contact_batch(file);
    case FileKind::fclib_local:
      return read_fclib_local(file);
    case FileKind::fclib_global:
      return read_fclib_global(file);
    case FileKind::fclib_rolling:
      break;
  }
  file.refuse(
      "an FCLIB rolling problem: it bounds the tangential and the rolling reaction of a contact each by its own "
      "disk, a friction cone of this library bounds them together by one ellipsoid, so the problem cannot be stated");
}

Law read_law(const InputFile& file, std::optional<Law> fallback) {
  const auto law = file.text_attribute("law");
  if (!law && fallback) return *fallback;
  if (!law) file.refuse("attribute 'law' is missing, expected 'convex' or 'coulomb'");
  if (*law == to_string(Law::convex)) return Law::convex;
  if (*law == to_string(Law::coulomb)) return Law::coulomb;
  file.refuse("attribute 'law' is '" + *law + "', expected 'convex' or 'coulomb'");
}

void check_offsets(const InputFile& file, const std::string& path, const std::vector<Offset>& offsets,
                   std::size_t last) {
  if (offsets.empty()) file.refuse_dataset(path, "is empty, expected at least the leading 0");
  if (offsets.front() != 0) file.refuse_dataset(path, "starts at " + std::to_string(offsets.front()) + ", expected 0");
  for (std::size_t i = 1; i < offsets.size(); ++i) {
    if (offsets[i] < offsets[i - 1]) {
      file.refuse_dataset(path, "decreases from " + std::to_string(offsets[i - 1]) + " to " +
                                    std::to_string(offsets[i]) + " at position " + std::to_string(i));
    }
  }
  if (offsets.back() != static_cast<Offset>(last)) {
    file.refuse_dataset(path, "ends at " + std::to_string(offsets.back()) + ", expected " + std::to_string(last));
  }
}

FileKind detect(const std::filesystem::path& path) {
  return kind_of(InputFile(path));
}

Recording read_batch(const std::filesystem::path& path) {
  const ScopedFpEnv fp_env;
  return read_any(InputFile(path));
}

SolutionFile read_solution(const std::filesystem::path& path) {
  const ScopedFpEnv fp_env;
  return read_solution(InputFile(path));
}

}  // namespace stiction::io
