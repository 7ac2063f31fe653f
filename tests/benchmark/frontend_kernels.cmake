# Front-end kernels beside OpenCV.
find_package(OpenCV REQUIRED COMPONENTS core imgproc video)
add_executable(benchmark_frontend_kernels ${CMAKE_CURRENT_LIST_DIR}/frontend_kernels.cpp)
target_link_libraries(benchmark_frontend_kernels PRIVATE
  swiftlet_flags swiftlet_frontend_log swiftlet::frontend ${OpenCV_LIBS})
target_include_directories(benchmark_frontend_kernels SYSTEM PRIVATE ${OpenCV_INCLUDE_DIRS})
