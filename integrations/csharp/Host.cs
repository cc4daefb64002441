// What the binding adds to Native.cs: errors, arrays, callbacks and handles, for Meshreel.cs.

using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using System.Runtime.InteropServices;
using System.Text;
using System.Threading;
using System.Threading.Tasks;

namespace Meshreel
{
    /// <summary>Unity's ahead-of-time compiler finds callbacks by this attribute name.</summary>
    [AttributeUsage(AttributeTargets.Method)]
    internal sealed class MonoPInvokeCallbackAttribute : Attribute
    {
        public MonoPInvokeCallbackAttribute(Type type) { }
    }

    internal static partial class Native
    {
        internal partial struct text
        {
            public override string ToString() => Encoding.UTF8.GetString(Copied<byte>(bytes, (long)size));
        }

        /// <summary>Throw the error that a function reported, unless it succeeded.</summary>
        internal static void Check(int code, ref error error)
        {
            if (code != 0)
            {
                throw Failure(ref error, (ReelCode)code == ReelCode.Unreadable ? Host.TakeFault() : null);
            }
        }

        internal static ReelException Failure(ref error error, Exception cause)
        {
            long? offset = error.offset == ulong.MaxValue ? (long?)null : (long)error.offset;
            string place = offset == null ? "" : " (byte " + offset + ")";
            string message = Marshal.PtrToStringAnsi(error.message) + place;
            return new ReelException((ReelCode)error.code, message, offset, (long)error.size, cause);
        }

        internal static T At<T>(IntPtr address) => (T)Marshal.PtrToStructure(address, typeof(T));

        /// <summary>Convert an array of C structures to objects.</summary>
        internal static TResult[] Each<T, TResult>(IntPtr address, uint count, Func<T, TResult> make)
        {
            var made = new TResult[checked((int)count)];
            int size = Marshal.SizeOf(typeof(T));
            for (int i = 0; i < made.Length; i++)
            {
                made[i] = make(At<T>(new IntPtr(address.ToInt64() + (long)i * size)));
            }
            return made;
        }

        internal static readonly Dictionary<ReelType, Type> NumberTypes = new Dictionary<ReelType, Type>
        {
            { ReelType.Float32, typeof(float) }, { ReelType.Float64, typeof(double) }, { ReelType.UInt8, typeof(byte) },
            { ReelType.UInt16, typeof(ushort) }, { ReelType.UInt32, typeof(uint) }, { ReelType.UInt64, typeof(ulong) },
            { ReelType.Int8, typeof(sbyte) }, { ReelType.Int16, typeof(short) }, { ReelType.Int32, typeof(int) },
            { ReelType.Int64, typeof(long) },
        };

        /// <summary>Copy an array of numbers; null for NULL.</summary>
        internal static T[] Copied<T>(IntPtr address, long count)
        {
            return (T[])Copied(address, NumberTypes.First(number => number.Value == typeof(T)).Key, count);
        }

        internal static Array Copied(IntPtr address, ReelType type, long count)
        {
            if (address == IntPtr.Zero && count > 0)
            {
                return null;
            }
            var bytes = new byte[checked(count * ((int)type & 15))];
            Array numbers = Array.CreateInstance(NumberTypes[type], count);
            if (count > 0)
            {
                Marshal.Copy(address, bytes, 0, bytes.Length);
                Buffer.BlockCopy(bytes, 0, numbers, 0, bytes.Length);
            }
            return numbers;
        }
    }

    /// <summary>The host of the library: provides bytes, memory and threads. Files and their segments share one,
    /// which the last of them releases.</summary>
    internal sealed class Host
    {
        [UnmanagedFunctionPointer(CallingConvention.Cdecl)]
        private delegate int ReadFunction(IntPtr user, ulong offset, IntPtr to, UIntPtr size);
        [UnmanagedFunctionPointer(CallingConvention.Cdecl)]
        private delegate IntPtr AllocateFunction(IntPtr user, UIntPtr size);
        [UnmanagedFunctionPointer(CallingConvention.Cdecl)]
        private delegate void ReleaseFunction(IntPtr user, IntPtr memory, UIntPtr size);
        [UnmanagedFunctionPointer(CallingConvention.Cdecl)]
        private delegate void RunFunction(IntPtr user, IntPtr task, IntPtr shared, uint count);
        [UnmanagedFunctionPointer(CallingConvention.Cdecl)]
        private delegate void TaskFunction(IntPtr shared, uint i);

        // Static, so that the garbage collector keeps them.
        private static readonly ReadFunction ReadDelegate = Read;
        private static readonly AllocateFunction AllocateDelegate = Allocate;
        private static readonly ReleaseFunction ReleaseDelegate = Release;
        private static readonly RunFunction RunDelegate = Run;

        private const int Alignment = 64;
        [ThreadStatic] private static Exception fault;

        private readonly byte[] bytes;
        private readonly Stream stream;
        private readonly bool leaveOpen;
        private readonly ReelOptions options;
        private readonly object turn = new object();
        private readonly byte[] piece;
        private GCHandle self, pinned;
        private int uses;

        internal Host(byte[] bytes, Stream stream, bool leaveOpen, ReelOptions options)
        {
            this.bytes = bytes;
            this.stream = stream;
            this.leaveOpen = leaveOpen;
            this.options = (options ?? new ReelOptions()).Copy();
            piece = stream == null ? null : new byte[1 << 16];
        }

        /// <summary>The last exception of `Read` on this thread.</summary>
        internal static Exception TakeFault()
        {
            Exception found = fault;
            fault = null;
            return found;
        }

        internal int Open(out IntPtr file, out Native.error error)
        {
            var source = new Native.source
            {
                bytes = bytes == null ? IntPtr.Zero : pinned.AddrOfPinnedObject(),
                size = (ulong)(bytes == null ? stream.Length : bytes.LongLength),
                read = bytes == null ? Marshal.GetFunctionPointerForDelegate(ReadDelegate) : IntPtr.Zero,
                user = GCHandle.ToIntPtr(self),
            };
            bool divides = options.Threads > 1;
            var host = new Native.host
            {
                user = GCHandle.ToIntPtr(self),
                allocate = Marshal.GetFunctionPointerForDelegate(AllocateDelegate),
                release = Marshal.GetFunctionPointerForDelegate(ReleaseDelegate),
                run = divides ? Marshal.GetFunctionPointerForDelegate(RunDelegate) : IntPtr.Zero,
                n_threads = (uint)options.Threads,
                memory_limit = (ulong)options.MemoryLimit,
            };
            return Native.meshreel_open(ref source, ref host, out file, out error);
        }

        internal void Retain()
        {
            if (Interlocked.Increment(ref uses) == 1)
            {
                self = GCHandle.Alloc(this);
                pinned = bytes == null ? default(GCHandle) : GCHandle.Alloc(bytes, GCHandleType.Pinned);
            }
        }

        internal void Release()
        {
            if (Interlocked.Decrement(ref uses) > 0)
            {
                return;
            }
            self.Free();
            if (bytes != null)
            {
                pinned.Free();
            }
            else if (!leaveOpen)
            {
                stream.Dispose();
            }
        }

        /// <summary>Copy bytes of the file; callable on any thread.</summary>
        internal void Read(long offset, long size, Action<byte[], int> take)
        {
            lock (turn)
            {
                if (bytes == null)
                {
                    stream.Position = offset;
                }
                while (size > 0)
                {
                    byte[] from = piece;
                    int count = (int)Math.Min(size, 1 << 16);
                    if (bytes != null)
                    {
                        from = new byte[count];
                        Array.Copy(bytes, offset, from, 0, count);
                        offset += count;
                    }
                    else if ((count = stream.Read(piece, 0, count)) == 0)
                    {
                        throw new EndOfStreamException("the stream ended " + size + " bytes too early");
                    }
                    take(from, count);
                    size -= count;
                }
            }
        }

        [MonoPInvokeCallback(typeof(ReadFunction))]
        private static int Read(IntPtr user, ulong offset, IntPtr to, UIntPtr size)
        {
            try
            {
                ((Host)GCHandle.FromIntPtr(user).Target).Read((long)offset, (long)size, (bytes, count) =>
                {
                    Marshal.Copy(bytes, 0, to, count);
                    to = new IntPtr(to.ToInt64() + count);
                });
                return 0;
            }
            catch (Exception exception)
            {
                fault = exception; // must not cross the library; `Check` passes it on
                return 1;
            }
        }

        /// <summary>Memory aligned to 64 bytes; the address of the allocation is stored before it.</summary>
        [MonoPInvokeCallback(typeof(AllocateFunction))]
        private static IntPtr Allocate(IntPtr user, UIntPtr size)
        {
            try
            {
                long whole = Marshal.AllocHGlobal(new IntPtr(checked((long)size + Alignment + IntPtr.Size))).ToInt64();
                var aligned = new IntPtr((whole + IntPtr.Size + Alignment - 1) / Alignment * Alignment);
                Marshal.WriteIntPtr(aligned, -IntPtr.Size, new IntPtr(whole));
                return aligned;
            }
            catch (Exception) // OutOfMemoryException, OverflowException: the library reports NoMemory
            {
                return IntPtr.Zero;
            }
        }

        [MonoPInvokeCallback(typeof(ReleaseFunction))]
        private static void Release(IntPtr user, IntPtr memory, UIntPtr size)
        {
            Marshal.FreeHGlobal(Marshal.ReadIntPtr(memory, -IntPtr.Size));
        }

        [MonoPInvokeCallback(typeof(RunFunction))]
        private static void Run(IntPtr user, IntPtr task, IntPtr shared, uint count)
        {
            try
            {
                var host = (Host)GCHandle.FromIntPtr(user).Target;
                var function = (TaskFunction)Marshal.GetDelegateForFunctionPointer(task, typeof(TaskFunction));
                Run(host.options.Threads, i => function(shared, i), count);
            }
            catch (Exception exception)
            {
                // The exception must not pass through the library, which waits for its tasks.
                Environment.FailFast("meshreel cannot run tasks on threads", exception);
            }
        }

        private static void Run(int threads, Action<uint> task, uint count)
        {
            long next = -1;
            Action work = () =>
            {
                for (long i = Interlocked.Increment(ref next); i < count; i = Interlocked.Increment(ref next))
                {
                    task((uint)i);
                }
            };
            try
            {
                var options = new ParallelOptions { MaxDegreeOfParallelism = threads };
                Parallel.For(0, (int)Math.Min(threads, count), options, i => work());
            }
            catch (Exception) // no more threads: this one does the rest
            {
            }
            work();
        }
    }

    /// <summary>The handle of a file; it is closed after its decoders, which hold references.</summary>
    internal sealed class FileHandle : SafeHandle
    {
        internal readonly Host Host;

        internal FileHandle(Host host) : base(IntPtr.Zero, true)
        {
            host.Retain();
            Host = host;
        }

        public override bool IsInvalid => false; // `ReleaseHandle` must always run: it releases the host

        internal void Open()
        {
            Native.error error;
            int code = Host.Open(out handle, out error);
            Native.Check(code, ref error);
        }

        internal void OpenSegment(FileHandle file, uint number)
        {
            Native.error error;
            int code = Native.meshreel_open_segment(file, number, out handle, out error);
            Native.Check(code, ref error);
        }

        protected override bool ReleaseHandle()
        {
            Native.meshreel_close(handle);
            Host.Release();
            return true;
        }
    }

    internal sealed class DecoderHandle : SafeHandle
    {
        private readonly FileHandle file;

        internal DecoderHandle(FileHandle file) : base(IntPtr.Zero, true)
        {
            bool isHeld = false;
            file.DangerousAddRef(ref isHeld);
            this.file = file;
        }

        public override bool IsInvalid => false;

        internal void Begin()
        {
            Native.error error;
            int code = Native.meshreel_begin(file, out handle, out error);
            Native.Check(code, ref error);
        }

        protected override bool ReleaseHandle()
        {
            if (file != null) // else the constructor failed
            {
                Native.meshreel_end(handle);
                file.DangerousRelease();
            }
            return true;
        }
    }
}
