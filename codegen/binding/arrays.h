// numpy arrays in and out: C order, double, checked shapes.
#ifndef CODEGEN_BINDING_ARRAYS_H_
#define CODEGEN_BINDING_ARRAYS_H_

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <array>
#include <cstddef>
#include <initializer_list>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace engram::binding {

namespace nb = nanobind;

// What numpy passes: copied to C order and double if it is neither.
template <int dimensions> using In = nb::ndarray<const double, nb::ndim<dimensions>, nb::c_contig, nb::device::cpu>;
using Out = nb::ndarray<nb::numpy, double>;

// Refuses an array whose sizes are not the expected ones (-1: any).
template <int dimensions>
inline void check_shape(const char* name, const In<dimensions>& a, const std::array<long, dimensions>& expected) {
  std::string found, wanted;
  bool fits = true;
  for (int i = 0; i < dimensions; ++i) {
    fits &= expected[i] < 0 || expected[i] == long(a.shape(i));
    found += std::to_string(a.shape(i)) + " ";
    wanted += (expected[i] < 0 ? std::string("any") : std::to_string(expected[i])) + " ";
  }
  if (!fits) throw nb::value_error((std::string(name) + ": expected shape ( " + wanted + "), found ( " + found + ")").c_str());
}

// A new array, owned by Python once returned.
class NewArray {
 public:
  explicit NewArray(std::initializer_list<std::size_t> shape) : shape_(shape) {
    std::size_t size = 1;
    for (std::size_t n : shape) size *= n;
    data_ = std::make_unique<double[]>(size);
  }
  double* data() { return data_.get(); }
  double* row(std::size_t i) {
    std::size_t size = 1;
    for (std::size_t d = 1; d < shape_.size(); ++d) size *= shape_[d];
    return data_.get() + i * size;
  }
  Out release() {
    double* const data = data_.release();
    return Out(data, shape_.size(), shape_.data(), nb::capsule(data, [](void* p) noexcept { delete[] static_cast<double*>(p); }));
  }

 private:
  std::vector<std::size_t> shape_;
  std::unique_ptr<double[]> data_;
};

}  // namespace engram::binding
#endif  // CODEGEN_BINDING_ARRAYS_H_
