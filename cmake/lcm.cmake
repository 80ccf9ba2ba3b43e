# engram_msg: the LCM messages of controller/io/lcm as a C library. They are the only thing that harness and controller share.
find_program(LCM_GEN lcm-gen REQUIRED)
find_library(LCM_LIBRARY lcm REQUIRED)
set(msg_dir ${CMAKE_BINARY_DIR}/lcm)
file(GLOB msg_files CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/controller/io/lcm/*.lcm)
set(msg_sources)
foreach(file ${msg_files})
  get_filename_component(name ${file} NAME_WE)
  list(APPEND msg_sources ${msg_dir}/engram_msg_${name}.c)
endforeach()
add_custom_command(
  OUTPUT ${msg_sources}
  COMMAND ${LCM_GEN} -c --c-cpath ${msg_dir} --c-hpath ${msg_dir} ${msg_files}
  COMMAND ${LCM_GEN} -p --ppath ${msg_dir} ${msg_files}
  DEPENDS ${msg_files}
  COMMENT "Generating LCM messages")
add_library(engram_msg STATIC ${msg_sources})
target_compile_options(engram_msg PRIVATE -w)
target_include_directories(engram_msg SYSTEM PUBLIC ${msg_dir})
target_link_libraries(engram_msg PUBLIC ${LCM_LIBRARY})
