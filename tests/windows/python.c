/* python.exe: hands the command line to the interpreter in python311.dll, as the program of python.org does. */
#include <windows.h>

typedef int (*main_function)(int count, wchar_t **words);

int wmain(int count, wchar_t **words) {
  HMODULE interpreter = LoadLibraryW(L"python311.dll");
  main_function run = interpreter ? (main_function)(void *)GetProcAddress(interpreter, "Py_Main") : NULL;
  return run ? run(count, words) : 103;
}
