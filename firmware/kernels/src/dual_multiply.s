@ The inner loops for Armv7E-M and Armv8-M with the DSP extension: two samples in a register.
@
@ C calling convention. Pointers need only a sample's alignment: LDR and STR of a word take any address on these processors
@ (LDM and LDRD do not). Only the elements named are read or written. `.cfi` lines state the depth of the stack.

    .syntax unified
    .arch   armv7e-m            @ stable Rust cannot switch the extension on; in Armv8-M main it is the same
    .cfi_sections .debug_frame

@ void echoloop_correlate(const i16 *taps, usize pairs, const i16 *x, i16 *y, usize sixteens)
@
@ y[n] = saturate((Σ taps[k] · x[n + k] + 2^14) >> 15)    k = 0..2·pairs − 1,  n = 0..16·sixteens − 1
@
@ pairs ≥ 1, sixteens ≥ 1. Reads taps[0 .. 2·pairs] and x[0 .. 16·sixteens + 2·pairs], writes y[0 .. 16·sixteens].
@
@ Four sums stay in registers while pairs of taps and samples pass by. Outputs 0 and 2 multiply pairs (x[k], x[k+1]), k even;
@ outputs 1 and 3 the pairs between, which are packed from halves of two, swapped: SMLADX swaps them back. So a pair of taps
@ costs two loads, one pack and eight multiplications in four instructions.

taps    .req r0             @ running
count   .req r1             @ running
x       .req r2             @ running
y       .req r3             @ running
sum0    .req r4
sum1    .req r5
sum2    .req r6
sum3    .req r7
evenA   .req r8             @ (x[k], x[k+1]) and (x[k+2], x[k+3]): which is which alternates
evenB   .req r9
odd     .req r10            @ (x[k+2], x[k+1])
tap     .req r11
fours   .req r12
pairs   .req lr

@ One pair of taps. `s0`..`s3`: start values of the sums.
.macro echoloop_step even, next, s0=sum0, s1=sum1, s2=sum2, s3=sum3
    ldr     tap, [taps], #4
    smlad   sum0, tap, \even, \s0
    smladx  sum1, tap, odd, \s1
    ldr     \even, [x], #4
    smlad   sum2, tap, \next, \s2
    pkhbt   odd, \even, \next
    smladx  sum3, tap, odd, \s3
.endm

@ All outputs, for a number of pairs that is `first` (1 to 4) and a multiple of four: the loop does four at a time.
.macro echoloop_outputs first
1:  ldr     evenA, [x], #4
    mov     sum3, #0x4000   @ half an LSB of y
    ldr     evenB, [x], #4
    subs    count, pairs, #\first
    pkhbt   odd, evenB, evenA
    echoloop_step evenA, evenB, sum3, sum3, sum3
.if \first > 1
    echoloop_step evenB, evenA
.endif
.if \first > 2
    echoloop_step evenA, evenB
.endif
.if \first > 3
    echoloop_step evenB, evenA
.endif
    beq     3f
2:
.rept 2
  .if \first % 2
    echoloop_step evenB, evenA
    echoloop_step evenA, evenB
  .else
    echoloop_step evenA, evenB
    echoloop_step evenB, evenA
  .endif
.endr
    subs    count, #4
    bne     2b
3:  ssat    sum0, #16, sum0, asr #15
    ssat    sum1, #16, sum1, asr #15
    pkhbt   sum0, sum0, sum1, lsl #16
    ssat    sum2, #16, sum2, asr #15
    ssat    sum3, #16, sum3, asr #15
    pkhbt   sum2, sum2, sum3, lsl #16
    str     sum0, [y], #4
    str     sum2, [y], #4
    sub     taps, taps, pairs, lsl #2
    sub     x, x, pairs, lsl #2     @ pairs + 2 words were read: four samples further than it began
    subs    fours, #1
    bne     1b
    pop     {r4-r11, pc}
.endm

    .section .text.echoloop_correlate, "ax", %progbits
    .global echoloop_correlate
    .type   echoloop_correlate, %function
    .thumb_func
    .p2align 2
echoloop_correlate:
    .cfi_startproc
    ldr     fours, [sp]
    push    {r4-r11, lr}
    .cfi_def_cfa_offset 36
    .cfi_offset lr, -4
    lsl     fours, #2
    mov     pairs, count
    ands    tap, pairs, #3
    beq.w   8f
    cmp     tap, #2
    beq.w   6f
    bhi.w   7f
    echoloop_outputs 1
6:  echoloop_outputs 2
7:  echoloop_outputs 3
8:  echoloop_outputs 4
    .cfi_endproc
    .size   echoloop_correlate, . - echoloop_correlate

@ void echoloop_remove_baseline(const u16 *codes, i16 *x, usize eights, u32 clips, u32 ambients, u32 shift)
@
@ x[n] = saturate(((min(codes[n], clip) << shift) as i16) − ambient)    n = 0..8·eights − 1
@
@ eights ≥ 1, clip << shift < 2^16; `clips` and `ambients` hold theirs twice. Reads codes[0 .. 8·eights], writes x of as many.

    .unreq taps
    .unreq count
    .unreq x
    .unreq y
    .unreq sum0
    .unreq sum1
    .unreq sum2
    .unreq sum3
    .unreq evenA
    .unreq evenB
    .unreq odd
    .unreq tap
    .unreq fours
    .unreq pairs

    .section .text.echoloop_remove_baseline, "ax", %progbits
    .global echoloop_remove_baseline
    .type   echoloop_remove_baseline, %function
    .thumb_func
    .p2align 2
echoloop_remove_baseline:
    .cfi_startproc
    push    {r4-r6, lr}
    .cfi_def_cfa_offset 16
    .cfi_offset lr, -4
    ldr     r4, [sp, #16]       @ ambients
    ldr     r5, [sp, #20]       @ shift
1:
.rept 4
    ldr     r6, [r0], #4
    usub16  r12, r6, r3         @ GE where code ≥ clip
    sel     r6, r3, r6
    lsl     r6, r6, r5          @ nothing crosses: clip << shift < 2^16
    qsub16  r6, r6, r4
    str     r6, [r1], #4
.endr
    subs    r2, #1
    bne     1b
    pop     {r4-r6, pc}
    .cfi_endproc
    .size   echoloop_remove_baseline, . - echoloop_remove_baseline

@ u32 echoloop_reaches(const i16 *values, usize count, u32 thresholds)
@
@ Returns not 0 when any of values[0 .. count] reaches the threshold. `thresholds` holds it twice.

    .section .text.echoloop_reaches, "ax", %progbits
    .global echoloop_reaches
    .type   echoloop_reaches, %function
    .thumb_func
    .p2align 2
echoloop_reaches:
    .cfi_startproc
    mov     r3, #-1             @ the signs of value − threshold: set while all lie below
    subs    r1, #16
    blo     2f
1:
.rept 8
    ldr     r12, [r0], #4
    qsub16  r12, r12, r2        @ saturating keeps the sign
    and     r3, r3, r12
.endr
    subs    r1, #16
    bhs     1b
2:  adds    r1, #16             @ what is left, each in both halves
    beq     4f
3:  ldrh    r12, [r0], #2
    orr     r12, r12, r12, lsl #16
    qsub16  r12, r12, r2
    and     r3, r3, r12
    subs    r1, #1
    bne     3b
4:  mvn     r0, r3
    and     r0, #0x80008000
    bx      lr
    .cfi_endproc
    .size   echoloop_reaches, . - echoloop_reaches

@ u32 echoloop_count(const u16 *codes, usize eights, u32 firsts, u16 *counts)
@
@ Adds one to counts[code − first] for each of codes[0 .. 8·eights] within first .. first + 128, and returns the number of codes below first.
@ eights ≥ 1, first + 128 ≤ 2^16, `firsts` holds first twice. Touches counts[0 .. 128] only.

.macro echoloop_count_one
    ldrh    r8, [r3, r7, lsl #1]
    adds    r8, #1
    strh    r8, [r3, r7, lsl #1]
.endm

@ Two samples, both within; else goes to the other macro of the same number and comes back.
.macro echoloop_count_two number
    ldr     r6, [r0], #4
    usub16  r6, r6, r2
    tst     r6, r5
    bne     .Lecholoop_beyond\number
    uxth    r7, r6
    echoloop_count_one
    lsr     r7, r6, #16
    echoloop_count_one
.Lecholoop_counted\number:
.endm

.macro echoloop_count_beyond number
.Lecholoop_beyond\number:
  .irp offset, -4, -2
    ldrh    r7, [r0, #\offset]
    uxth    r8, r2
    subs    r7, r7, r8
    it      lo
    addlo   r4, #1
    cmp     r7, #128
    bhs     4f
    echoloop_count_one
4:
  .endr
    b       .Lecholoop_counted\number
.endm

    .section .text.echoloop_count, "ax", %progbits
    .global echoloop_count
    .type   echoloop_count, %function
    .thumb_func
    .p2align 2
echoloop_count:
    .cfi_startproc
    push    {r4-r8, lr}
    .cfi_def_cfa_offset 24
    .cfi_offset lr, -4
    mov     r4, #0              @ below
    mov     r5, #0xff80
    orr     r5, r5, r5, lsl #16 @ what a bin within does not have
1:  echoloop_count_two 0
    echoloop_count_two 1
    echoloop_count_two 2
    echoloop_count_two 3
    subs    r1, #1
    bne     1b
    mov     r0, r4
    pop     {r4-r8, pc}
    echoloop_count_beyond 0
    echoloop_count_beyond 1
    echoloop_count_beyond 2
    echoloop_count_beyond 3
    .cfi_endproc
    .size   echoloop_count, . - echoloop_count
