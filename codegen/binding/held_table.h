// A table of engram.emit.kinds held in memory, as a generated C file would hold it: the same struct, the same arrays.
#ifndef CODEGEN_BINDING_HELD_TABLE_H_
#define CODEGEN_BINDING_HELD_TABLE_H_

#include "controller/tab/tab.h"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <string>
#include <vector>

namespace engram::binding {

namespace nb = nanobind;

// Every kind's struct is a TabHead, then its scalars (32-bit integers and floats, as fields() lists them), then pointers to its arrays
// behind the domain: so one class fills them all.
class HeldTable {
  struct Free {
    void operator()(void* p) const { std::free(p); }
  };

 public:
  HeldTable(const nb::object& source, uint64_t robot_digest, uint64_t task_digest)
      : name_(nb::cast<std::string>(source.attr("role"))) {
    TabHead head{};
    head.schema = nb::cast<uint32_t>(source.attr("schema"));
    head.kind = nb::cast<uint32_t>(source.attr("number"));
    head.name = name_.c_str();
    head.robot_digest = robot_digest;
    head.task_digest = task_digest;
    head.nin = int(nb::cast<nb::list>(source.attr("inputs")).size());
    head.nout = nb::cast<int>(source.attr("outputs"));
    for (nb::handle item : source.attr("arrays")()) {
      if (head.narray == TAB_ARRAYS) throw nb::value_error("too many arrays in a table");
      const auto words = nb::cast<nb::ndarray<const uint32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>>(item.attr("words"));
      const std::size_t bytes = (4 * words.size() + 63) / 64 * 64;
      void* const data = arrays_.emplace_back(std::aligned_alloc(64, bytes > 0 ? bytes : 64)).get();
      if (!data) throw std::bad_alloc();
      std::memcpy(data, words.data(), 4 * words.size());
      head.array[head.narray++] = {"", data, words.size()};
    }
    head.digest = tab_digest(&head);
    std::vector<uint32_t> scalars;
    for (nb::handle value : nb::cast<nb::dict>(source.attr("fields")()).values()) {
      uint32_t word;
      if (nb::isinstance<nb::int_>(value)) {
        const int32_t integer = nb::cast<int32_t>(value);
        std::memcpy(&word, &integer, 4);
      } else {
        const float number = nb::cast<float>(nb::float_(value));
        std::memcpy(&word, &number, 4);
      }
      scalars.push_back(word);
    }
    if (scalars.size() % 2) scalars.push_back(0);  // pointers are aligned to eight bytes
    const std::size_t scalar_bytes = 4 * scalars.size();
    struct_.resize((sizeof head + scalar_bytes) / 8 + TAB_ARRAYS);
    char* at = reinterpret_cast<char*>(struct_.data());
    std::memcpy(at, &head, sizeof head);
    std::memcpy(at += sizeof head, scalars.data(), scalar_bytes);
    at += scalar_bytes;
    for (int i = 2; i < head.narray; ++i, at += sizeof(void*)) std::memcpy(at, &head.array[i].data, sizeof(void*));
  }
  HeldTable(const HeldTable&) = delete;  // the struct points into the arrays
  HeldTable& operator=(const HeldTable&) = delete;

  const TabHead* head() const { return reinterpret_cast<const TabHead*>(struct_.data()); }
  template <class Tab> const Tab* as() const { return reinterpret_cast<const Tab*>(struct_.data()); }

 private:
  std::string name_;
  std::vector<std::unique_ptr<void, Free>> arrays_;  // aligned to cache lines, as in a generated file
  std::vector<uint64_t> struct_;              // eight bytes: aligned for pointers
};

}  // namespace engram::binding
#endif  // CODEGEN_BINDING_HELD_TABLE_H_
