#include <array>
#include <string>

#include "tests/fuzz/c_session.hpp"

namespace stiction::fuzz {
namespace {

/// Up to 15 characters.
std::string text(Bytes& bytes) {
  std::string result;
  for (int length = bytes.below(16); length > 0; --length) result.push_back(static_cast<char>(bytes.byte()));
  return result;
}

template <class Struct, class Init>
void set_up(Bytes& bytes, Init init) {
  std::array<Struct, 2> room{};  // a struct of a longer size is refused and not written to
  const std::size_t size = wild_size(bytes, sizeof(Struct));
  succeeded(init(bytes.once_in(16) ? nullptr : room.data(), size));
}

void set_up_any(Bytes& bytes) {
  switch (bytes.below(6)) {
    case 0:
      return set_up<stiction_solver_options>(bytes, stiction_solver_options_init);
    case 1:
      return set_up<stiction_batch_view>(bytes, stiction_batch_view_init);
    case 2:
      return set_up<stiction_jacobian_view>(bytes, stiction_jacobian_view_init);
    case 3:
      return set_up<stiction_body_view>(bytes, stiction_body_view_init);
    case 4:
      return set_up<stiction_body_options>(bytes, stiction_body_options_init);
    default:
      return set_up<stiction_warm_start_options>(bytes, stiction_warm_start_options_init);
  }
}

void hash(Bytes& bytes) {
  std::vector<double> values(static_cast<std::size_t>(bytes.below(9)));
  for (double& value : values) value = wild<double>(bytes);
  const auto count = static_cast<std::int64_t>(values.size());
  const std::int64_t counts[] = {count, 0, -1, std::numeric_limits<std::int64_t>::min()};
  std::uint64_t result = 0;
  succeeded(stiction_hash(wild_integer<std::int32_t>(bytes, STICTION_F64), bytes.once_in(8) ? nullptr : values.data(),
                          bytes.one_of(counts), bytes.once_in(8) ? nullptr : &result));
}

/// No file is opened that is there.
void files(Bytes& bytes) {
  constexpr const char* kPaths[] = {"", nullptr, "/no such folder/batch.h5", "/"};
  const char* path = bytes.one_of(kPaths);
  stiction_batch* batch = nullptr;
  require(!succeeded(stiction_batch_read(path, &batch)) && batch == nullptr, "what is no file is not read");
  const auto form = contact_form<double>();
  require(!succeeded(stiction_batch_write(path, &form.view, nullptr)), "a place that is no file is not written to");
  stiction_batch_view view;
  stiction_batch_view_init(&view, sizeof view);
  require(!succeeded(stiction_batch_get_view(batch, bytes.byte(), &view)), "no batch has no view");
  require(succeeded(stiction_batch_destroy(batch)), "null is a handle that destroy accepts");
}

}  // namespace

void call_library(Bytes& bytes) {
  switch (bytes.below(6)) {
    case 0:
      return set_up_any(bytes);
    case 1:
      return hash(bytes);
    case 2: {
      std::int32_t solver = 0;
      succeeded(stiction_solver_from_name(text(bytes).c_str(), bytes.once_in(8) ? nullptr : &solver));
      const auto number = bytes.raw<std::int32_t>();
      require(stiction_code_name(number) != nullptr && stiction_env_code_name(number) != nullptr &&
                  stiction_solver_name(number) != nullptr &&
                  stiction_flag_name(static_cast<std::uint32_t>(number)) != nullptr,
              "every number has a name");
      return;
    }
    case 3: {
      std::vector<char> room(static_cast<std::size_t>(bytes.below(64)));
      std::size_t length = 0;
      succeeded(stiction_devices(room.data(), room.size(), bytes.once_in(4) ? nullptr : &length));
      return;
    }
    case 4: {
      stiction_solver_options options;
      stiction_solver_options_init(&options, sizeof options);
      succeeded(stiction_solver_options_preset(&options, text(bytes).c_str()));
      return;
    }
    default:
      return files(bytes);
  }
}

}  // namespace stiction::fuzz
